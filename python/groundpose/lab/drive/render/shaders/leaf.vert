// Leaves, fences, signs, posts, people: lit per vertex because there are so many.
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
out vec3 uvl;
out vec3 lit;
out float air;
uniform float lamps;
uniform vec2 leaves;         // first and last layer

void main() {
    vec3 p, n;
    vec3 local = in_position * in_size.xyz;
    vec3 m = in_normal / max(in_size.xyz, vec3(1e-3));
    p = vec3(dot(in_row0, vec4(local, 1.0)), dot(in_row1, vec4(local, 1.0)), dot(in_row2, vec4(local, 1.0)));
    n = normalize(vec3(dot(in_row0.xyz, m), dot(in_row1.xyz, m), dot(in_row2.xyz, m)));
    vec3 a = abs(in_normal);
    vec2 laid = a.y > 0.7 ? local.xz : (a.x > a.z ? vec2(local.z, local.y) : vec2(local.x, local.y));
    uvl = vec3(in_layer.y > 0.0 ? laid / in_layer.y + floor(in_size.w * 8.0) * 0.5 : in_uv, in_layer.x);
    vec3 tint = in_colour.rgb * mix(vec3(1.0), in_tint.rgb, in_colour.a);
    float leafy = in_layer.x >= leaves.x && in_layer.x <= leaves.y ? 1.0 : 0.0;
    vec3 view = normalize(eye - p);
    n = leafy < 0.5 && dot(n, view) < 0.0 ? -n : n;
    float nl = max(dot(n, sun_direction), 0.0);
    // Leaves are translucent when the camera looks towards the sun.
    float sun = mix(nl, 0.75 * nl + 0.3 * max(dot(-view, sun_direction), 0.0) + 0.12, leafy);
    lit = tint * (ambient(n) + sun_colour * sun * sun_visible(p, n * (1.0 - leafy)) + ego_lamps(p, n));
    lit = in_layer.y < -0.5 ? tint * (0.25 + lamps * 3.0) : lit;
    air = exp(-haze.w * distance(p, eye));
    gl_Position = clip_from_world * vec4(p, 1.0);
}
