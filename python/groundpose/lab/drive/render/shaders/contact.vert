// A flat piece under a vehicle that darkens the road.
uniform mat4 clip_from_world;
in vec2 in_corner;
in vec4 in_row0;
in vec4 in_row1;
in vec4 in_row2;
in vec4 in_half;   // half width, half length, reach, clearance
out vec2 q;
flat out vec4 half_size;
void main() {
    q = in_corner * (in_half.xy + in_half.z);
    half_size = in_half;
    vec4 local = vec4(q.x, -0.012, q.y, 1.0);
    vec3 p = vec3(dot(in_row0, local), dot(in_row1, local), dot(in_row2, local));
    gl_Position = clip_from_world * vec4(p, 1.0);
    gl_Position.z -= 0.0004 * gl_Position.w;
}
