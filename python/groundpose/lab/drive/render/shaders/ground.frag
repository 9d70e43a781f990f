// Road, markings, kerb, pavement, verge.
uniform sampler2DArray layers;
uniform vec4 surfaces[8];   // by material: layer, metres a picture covers, brightness, 1 = asphalt 2 = marking
uniform int crack_layer;
uniform vec4 wear;          // cracks, tar, patches, wetness
uniform vec3 road_tint;
in vec3 p;
in vec3 n;
flat in int material;
out vec4 colour;
void main() {
    vec4 s = surfaces[material];
    vec3 albedo = texture(layers, vec3(p.xz / s.y, s.x)).rgb;
    albedo *= albedo * s.z;
    vec4 wide = texture(grain, p.xz * 0.027), mid = texture(grain, p.xz * 0.13);
    vec4 crack = texture(layers, vec3(p.xz * 0.047, crack_layer));
    float asphalt = s.w > 0.5 ? 1.0 : 0.0;
    float marking = s.w > 1.5 ? 1.0 : 0.0;
    albedo *= mix(vec3(1.0), road_tint * (1.0 - wear.z * 0.35 * crack.b) * (1.0 - 0.3 * crack.a), asphalt);
    albedo *= 0.72 + 0.56 * (0.6 * wide.g + 0.4 * mid.g);
    float worn = smoothstep(0.32, 0.62, mid.g * 0.6 + mid.a * 0.4 + 0.25 * (1.0 - wear.x));
    albedo = mix(albedo, vec3(0.62, 0.62, 0.58) * (0.8 + 0.3 * mid.g), marking * (0.25 + 0.7 * worn));
    float lines = max(crack.r * wear.x, crack.g * wear.y) * asphalt;
    albedo = mix(albedo, vec3(0.012), clamp(lines, 0.0, 1.0) * 0.8);
    vec3 view = normalize(eye - p);
    vec3 normal = normalize(n);
    float sun = sun_visible(p, normal);
    float nl = max(dot(normal, sun_direction), 0.0);
    vec3 light = ambient(normal) + sun_colour * nl * sun + ego_lamps(p, normal);
#ifdef WET
    float wet = wear.w * asphalt * smoothstep(0.35, 0.65, 0.5 * wide.b + 0.5 * mid.g + 0.5 * (wear.w - 0.5));
    vec3 bump = normalize(normal + 0.03 * vec3(mid.r - 0.5, 0.0, mid.a - 0.5));
    vec3 mirror = surroundings(reflect(-view, bump), 0.1);
    float f = fresnel(max(dot(normal, view), 0.0), 0.02) * 0.9 * wet;
    vec3 c = albedo * (1.0 - 0.5 * wet) * light * (1.0 - f) + mirror * f;
    c += sun_colour * sun * glint(normal, view, sun_direction, mix(0.55, 0.12, wet)) * 0.04;
#else
    vec3 c = albedo * light;
    // Dry asphalt shines towards a low sun and pales at grazing angles.
    c += sun_colour * sun * glint(normal, view, sun_direction, 0.55) * 0.04;
    c += haze.rgb * asphalt * 0.1 * fresnel(max(dot(normal, view), 0.0), 0.0);
#endif
    colour = vec4(through_air(c, p), 1.0);
}
