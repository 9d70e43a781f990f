uniform mat4 clip_from_world;
uniform vec4 base[32];      // by material: albedo, roughness
uniform vec4 layer[32];     // by material: metal, coat, pattern, fraction of paint
in vec3 in_position;
in vec3 in_normal;
in vec3 in_local;           // place within its part, -1 to 1
in float in_material;
in vec2 in_pivot;           // x and z of the axis about which a front wheel steers; x 0 elsewhere
in vec4 in_row0;
in vec4 in_row1;
in vec4 in_row2;
in vec4 in_paint;           // rgb, flakes
in vec4 in_second;          // rgb, roughness of the coat
in vec4 in_state;           // dirt, lamps, brake, plate
in vec4 in_extra;           // random number, light through a pane, steering angle, side whose indicators shine
out vec3 plate;
#ifdef CORNERS
out vec4 lit;
vec3 p, n, local, side, shine;
float height;
vec4 surface, kind, state, extra;
#else
out vec3 p;
out vec3 n;
out vec3 local;
out float height;
out vec3 side;
flat out vec4 surface;
flat out vec4 kind;
flat out vec4 state;
flat out vec4 extra;
flat out vec3 shine;
#endif
void main() {
    int m = int(in_material + 0.5);
    vec4 q = vec4(in_position, 1.0);
    vec3 facing = in_normal;
    if (in_pivot.x != 0.0) {
        float c = cos(in_extra.z), s = sin(in_extra.z);
        mat2 turn = mat2(c, -s, s, c);
        q.xz = in_pivot + turn * (q.xz - in_pivot);
        facing.xz = turn * facing.xz;
    }
    p = vec3(dot(in_row0, q), dot(in_row1, q), dot(in_row2, q));
    n = vec3(dot(in_row0.xyz, facing), dot(in_row1.xyz, facing), dot(in_row2.xyz, facing));
    side = in_normal;
    local = in_local;
    height = -in_position.y;
    surface = base[m];
    kind = layer[m];
    state = in_state;
    extra = in_extra;
    float paint = kind.w == 1.0 ? 1.0 : 0.0, second = kind.w == 2.0 ? 1.0 : 0.0;
    surface.rgb = mix(mix(surface.rgb, in_paint.rgb, paint), in_second.rgb, second);
    kind.x = mix(kind.x, in_paint.w, paint);
    surface.w = mix(surface.w, in_second.w, paint);
    float on = in_state.y, brake = in_state.z;
    shine = vec3(0.0);
    shine += kind.z == HEADLAMP ? vec3(1.0, 0.96, 0.86) * 6.0 * on : vec3(0.0);
    shine += kind.z == TAILLAMP ? vec3(1.0, 0.06, 0.03) * (1.2 * on + 5.0 * brake) : vec3(0.0);
    shine += kind.z == INDICATOR && in_position.x * in_extra.w > 0.0 ? vec3(1.0, 0.4, 0.03) * 5.0 : vec3(0.0);
    shine += kind.z == DISPLAY ? vec3(1.0, 0.6, 0.1) * (0.15 + 0.6 * on) : vec3(0.0);
    // Letters are on faces turned forward or back; the rim of a plate has none.
    float letters = kind.z == PLATE && abs(side.z) > 0.6 ? 1.0 : 0.0;
    plate = vec3(local.x * sign(side.z) * -0.5 + 0.5, (0.94 * local.y * 0.5 + 0.5 + in_state.w) / 32.0, letters);
    gl_Position = clip_from_world * vec4(p, 1.0);
#ifdef CORNERS
    lit = shade(Point(p, n, local, side, height, surface, kind, state, extra, shine));
#endif
}
