// Light that reaches a point: sky harmonics, sun with shadow map, reflections of sky and street.
uniform vec3 eye;
uniform vec3 sun_direction;       // points to the sun
uniform vec3 sun_colour;
uniform vec3 sky_harmonics[9];
uniform vec2 sky_turn;            // cosine and sine: world azimuth to the panorama's
uniform vec3 sky_gain;            // panorama to radiance
uniform vec4 sky_zenith;          // rgb of the clear sky, fraction of it
uniform vec4 sky_horizon;         // rgb, clouds
uniform vec3 ground_colour;       // radiance of the road around
uniform vec4 street;              // rgb radiance of what stands beside the road, sine of its height
uniform vec4 haze;                // rgb, density per metre
uniform vec4 gobo;                // shade of things outside the scene: scale, threshold, softness, depth
uniform vec4 headlight;           // ego lamps: rgb, cosine of the cone
uniform vec3 forward;
uniform mat4 shadow_near;
uniform mat4 shadow_far;
uniform float shadow_blur;        // texels
uniform sampler2D panorama;
uniform sampler2D grain;          // four noises
uniform sampler2DShadow shadow_map;

const vec2 SHADOW_TEXEL = vec2(1.0 / 2048.0, 1.0 / 1024.0);
const float PI = 3.14159265;
const float KEPT = 512.0 / 288.0; // rows of a full panorama to rows kept

vec3 to_sky(vec3 d) {             // x, up, z in the panorama's frame
    return vec3(d.x * sky_turn.x + d.z * sky_turn.y, -d.y, d.z * sky_turn.x - d.x * sky_turn.y);
}

vec3 ambient(vec3 n) {
    vec3 d = to_sky(n);
    vec3 e = sky_harmonics[0] * 0.282095
        + 0.488603 * (sky_harmonics[1] * d.y + sky_harmonics[2] * d.z + sky_harmonics[3] * d.x)
        + 1.092548 * (sky_harmonics[4] * d.x * d.y + sky_harmonics[5] * d.y * d.z + sky_harmonics[7] * d.x * d.z)
        + sky_harmonics[6] * 0.315392 * (3.0 * d.z * d.z - 1.0)
        + sky_harmonics[8] * 0.546274 * (d.x * d.x - d.y * d.y);
    // Things beside the road hide part of the sky from upright faces.
    float side = 1.0 - 0.55 * street.w * (1.0 - max(d.y, 0.0)) * 2.0;
    return max(e, 0.0) * max(side, 0.2) + ground_colour * (0.5 - 0.5 * d.y) + street.rgb * 0.3 * (1.0 - abs(d.y));
}

vec3 mirrored_sky(vec3 direction, float lod) {
    vec3 d = to_sky(direction);
    vec2 uv = vec2(atan(d.x, d.z) / (2.0 * PI), acos(clamp(d.y, -0.18, 1.0)) / PI * KEPT);
    vec3 c = textureLod(panorama, uv, lod).rgb;
    c *= c;
    float bright = dot(c, vec3(0.3333)), near_sun = max(dot(direction, sun_direction), 0.0);
    vec3 clear = mix(sky_horizon.rgb, sky_zenith.rgb, sqrt(max(d.y, 0.0)));
    c = mix(c * sky_gain * (1.0 + 2.5 * smoothstep(0.75, 1.0, bright)), clear, 0.6 * sky_zenith.w);
    return c + sun_colour * 0.15 * pow(near_sun, 16.0);
}

vec3 sky(vec3 direction, float lod) {
    vec3 d = to_sky(direction);
    float up = max(d.y, 0.0);
    vec2 uv = vec2(atan(d.x, d.z) / (2.0 * PI), acos(clamp(d.y, -0.18, 1.0)) / PI * KEPT);
    vec3 c = textureLod(panorama, uv, lod).rgb;
    c *= c;
    float bright = dot(c, vec3(0.3333));
    c *= sky_gain * (1.0 + 2.5 * smoothstep(0.75, 1.0, bright));
    vec3 clear = mix(sky_horizon.rgb, sky_zenith.rgb, sqrt(up));
    vec4 n = textureLod(grain, d.xz / (up + 0.12) * 0.11 + sky_turn, max(lod - 1.0, 0.0));
    float cloud = smoothstep(0.56, 0.78, 0.55 * n.g + 0.45 * n.b + 0.1 * n.a) * sky_horizon.w;
    clear = mix(clear, dot(sky_horizon.rgb, vec3(0.45)) * vec3(1.0, 1.0, 1.02), cloud);
    float near_sun = max(dot(direction, sun_direction), 0.0);
    clear += sun_colour * (0.12 * pow(near_sun, 12.0) + 0.5 * pow(near_sun, 120.0));
    return mix(c, clear, sky_zenith.w);
}

// Reflection in a vehicle's surface: sky above, the dark sides of the street, the road below.
vec3 surroundings(vec3 d, float rough) {
    float up = -d.y;
    vec2 az = vec2(atan(d.x, d.z) * 0.6366, 0.0);
    vec4 n = textureLod(grain, vec2(az.x * 0.5, up * 0.3 + 0.37), 3.0);
    float line = street.w * (0.35 + 1.3 * n.g) ;
    float soft = 0.015 + 0.5 * rough;
    vec3 side = street.rgb * (0.35 + 1.3 * n.a);
    vec3 c = mix(side, mirrored_sky(d, 1.0 + 6.0 * rough), smoothstep(line - soft, line + soft, up));
    vec3 road = ground_colour * (1.0 + 0.3 * (n.a - 0.5));
    return mix(c, road, smoothstep(0.01 + soft, -0.02 - soft, up));
}

float shade_of_far_things(vec3 p) {
    vec2 q = p.xz - sun_direction.xz / min(sun_direction.y, -0.05) * p.y;
    vec4 n = textureLod(grain, q * gobo.x, 0.0);
    return 1.0 - gobo.w * smoothstep(gobo.y - gobo.z, gobo.y + gobo.z, 0.65 * n.b + 0.35 * n.g);
}

// Fraction of the sun that reaches a point: the fine map near the camera, else the wide one.
float sun_visible(vec3 p, vec3 n) {
    vec3 q = p + n * 0.03;
    vec3 a = (shadow_near * vec4(q, 1.0)).xyz, b = (shadow_far * vec4(q, 1.0)).xyz;
    bool close = all(lessThan(abs(a - 0.5), vec3(0.497)));
    vec3 c = close ? a : b;
    float inside = all(lessThan(abs(c - 0.5), vec3(0.499))) ? 1.0 : 0.0;
    vec2 uv = vec2(c.x * 0.5 + (close ? 0.0 : 0.5), c.y);
    vec2 r = shadow_blur * (close ? vec2(0.9, 0.4) : vec2(0.35, 0.15)) * SHADOW_TEXEL;
    float s = 0.5 * (texture(shadow_map, vec3(uv - r, c.z)) + texture(shadow_map, vec3(uv + r.yx * vec2(-1.0, 1.0), c.z)));
    return mix(1.0, s, inside) * shade_of_far_things(p);
}

vec3 ego_lamps(vec3 p, vec3 n) {
    vec3 l = eye - p;
    float d2 = dot(l, l);
    l *= inversesqrt(d2);
    float cone = smoothstep(headlight.w, 1.0, dot(-l, forward));
    return headlight.rgb * cone * max(dot(n, l), 0.0) * 60.0 / (d2 + 20.0);
}

float glint(vec3 n, vec3 v, vec3 l, float roughness) {  // GGX with the Smith term of Karis (2013)
    vec3 h = normalize(v + l);
    float a = roughness * roughness, nh = max(dot(n, h), 0.0), nl = max(dot(n, l), 0.0), nv = abs(dot(n, v)) + 1e-3;
    float d = nh * nh * (a * a - 1.0) + 1.0;
    float k = a * 0.5;
    float g = 0.25 / ((nl * (1.0 - k) + k) * (nv * (1.0 - k) + k));
    return min(a * a / max(d * d, 1e-7) * g * nl, 60.0);
}

float fresnel(float cosine, float f0) { float m = 1.0 - cosine; float q = m * m; return f0 + (1.0 - f0) * q * q * m; }

vec3 through_air(vec3 colour, vec3 p) {
    return mix(haze.rgb, colour, exp(-haze.w * distance(p, eye)));
}
