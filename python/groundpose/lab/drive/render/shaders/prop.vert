uniform mat4 clip_from_world;
in vec3 in_position;
in vec3 in_normal;
in vec2 in_uv;
in vec2 in_layer;           // layer, metres a picture covers
in vec4 in_colour;          // rgb, fraction of tint
in vec4 in_row0;            // world_from_object without the size
in vec4 in_row1;
in vec4 in_row2;
in vec4 in_size;            // size, random number
in vec4 in_tint;
out vec3 p;
out vec3 n;
out vec3 uvl;
out vec3 tint;
flat out float random;
void main() {
    vec3 local = in_position * in_size.xyz;
    vec3 m = in_normal / max(in_size.xyz, vec3(1e-3));
    p = vec3(dot(in_row0, vec4(local, 1.0)), dot(in_row1, vec4(local, 1.0)), dot(in_row2, vec4(local, 1.0)));
    n = normalize(vec3(dot(in_row0.xyz, m), dot(in_row1.xyz, m), dot(in_row2.xyz, m)));
    vec3 a = abs(in_normal);
    vec2 laid = a.y > 0.7 ? local.xz : (a.x > a.z ? vec2(local.z, local.y) : vec2(local.x, local.y));
    uvl = vec3(in_layer.y > 0.0 ? laid / in_layer.y + floor(in_size.w * 8.0) * 0.5 : in_uv, in_layer.x);
    tint = in_colour.rgb * mix(vec3(1.0), in_tint.rgb, in_colour.a);
    random = in_size.w;
    gl_Position = clip_from_world * vec4(p, 1.0);
}
