// The light a point of a vehicle sends to the eye: paint with flakes under a clear coat, plastic, rubber,
// chrome, lamps; with GLASS the panes. Used per pixel, or per vertex with CORNERS.
#ifdef CORNERS
#define GRAIN(q) textureLod(grain, q, 2.0)
#else
#define GRAIN(q) texture(grain, q)
#endif

struct Point {
    vec3 p, n, local, side;   // world, normal, place within the part -1 to 1, normal in the object frame
    float height;
    vec4 surface;             // albedo, roughness
    vec4 kind;                // metal, coat, pattern, fraction of paint
    vec4 state;               // dirt, lamps, brake, plate
    vec4 extra;               // random number, light through a pane, steering, indicators
    vec3 shine;
};

vec4 shade(Point s) {
    vec3 p = s.p;
    vec3 view = normalize(eye - p);
    vec3 normal = normalize(s.n);
    float nv = max(dot(normal, view), 0.0);
    float sun = sun_visible(p, normal);
    float nl = max(dot(normal, sun_direction), 0.0);
    vec3 mirrored = reflect(-view, normal);
#ifdef GLASS
    float f = fresnel(nv, 0.055);
    vec3 c = surroundings(mirrored, 0.03) * f;
    c += sun_colour * sun * glint(normal, view, sun_direction, 0.1) * 0.05;
    c += (ambient(normal) + sun_colour * sun * nl) * (0.004 + 0.02 * s.state.x);
    return vec4(through_air(c, p), 1.0 - (1.0 - f) * s.extra.y);
#else
    vec4 spot = GRAIN(vec2(p.x + p.z, p.y + 0.3 * p.z) * 0.7 + s.extra.x);
    vec3 albedo = s.surface.rgb;
    float pattern = s.kind.z;
    float slat = smoothstep(-0.2, 0.3, sin(s.local.y * 14.0) + 0.4 * sin(s.local.x * 40.0 * step(0.5, s.extra.x)));
    albedo *= pattern == GRILLE ? 0.3 + 1.2 * slat : 1.0;
    float facet = 0.4 + 1.2 * spot.a * (1.0 + 0.6 * sin(s.local.x * 23.0 + 5.0 * s.local.y));
    albedo *= pattern == HEADLAMP || pattern == TAILLAMP ? facet : 1.0;
    // Dirt thrown up from the road, most on the sills and behind the wheels.
    float dirt = s.state.x * smoothstep(1.1, 0.1, s.height + 0.5 * (spot.g - 0.5)) * (0.5 + spot.g);
    albedo = mix(albedo, vec3(0.13, 0.115, 0.095), clamp(dirt, 0.0, 0.85));
    float coat = s.kind.y * (1.0 - clamp(1.4 * dirt, 0.0, 1.0));
    float metal = s.kind.x, rough = mix(s.surface.w, 0.7, clamp(dirt, 0.0, 1.0));
    // Near the road the body and the ground shade each other; little light reaches the cabin.
    float open = mix(0.25, 1.0, smoothstep(-0.1, 0.75, s.height)) * (1.0 - 0.5 * max(s.side.y, 0.0));
    open *= pattern == CABIN ? 0.3 : 1.0;
    vec3 light = ambient(normal) * open + ego_lamps(p, normal);
    float flake = metal * (0.75 + 0.5 * spot.r);
    vec3 c = albedo * (1.0 - 0.75 * metal) * (light + sun_colour * nl * sun);
    vec3 soft = max(ambient(mirrored), 0.0) * open;
    soft += sun_colour * sun * glint(normal, view, sun_direction, max(rough, 0.38));
    c += albedo * flake * soft;
    float polished = coat * mix(1.0, 0.55, step(0.3, rough));
    float f0 = mix(0.04, 0.62, step(0.9, metal) * step(0.5, s.kind.y));
    float f = fresnel(nv, f0) * polished;
    vec3 seen = surroundings(mirrored, rough) * mix(0.45, 1.0, open);
    c = c * (1.0 - f) + seen * f;
    c += sun_colour * sun * glint(normal, view, sun_direction, max(rough, 0.07)) * 0.045 * polished;
    return vec4(through_air(c + s.shine * (0.35 + 0.65 * nv), p), 1.0);
#endif
}
