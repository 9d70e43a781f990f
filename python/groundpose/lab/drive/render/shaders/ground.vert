uniform mat4 clip_from_world;
in vec3 in_position;
in vec3 in_normal;
in float in_material;
out vec3 p;
out vec3 n;
flat out int material;
void main() {
    p = in_position; n = in_normal; material = int(in_material + 0.5);
    gl_Position = clip_from_world * vec4(p, 1.0);
}
