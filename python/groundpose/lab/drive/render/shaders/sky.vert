uniform mat3 ray_from_clip;   // world ray of a point of the window
out vec3 ray;
void main() {
    vec2 p = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    ray = ray_from_clip * vec3(p, 1.0);
    gl_Position = vec4(p, 1.0, 1.0);
}
