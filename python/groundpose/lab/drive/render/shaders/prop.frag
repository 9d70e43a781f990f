// Solid things beside the road; windows mirror the sky.
uniform sampler2DArray layers;
uniform vec2 facades;       // first and last layer with windows
uniform float lamps;        // lit windows
in vec3 p;
in vec3 n;
in vec3 uvl;
in vec3 tint;
flat in float random;
out vec4 colour;
void main() {
    vec4 t = texture(layers, uvl);
    float layer = floor(uvl.z + 0.5);
    float glass = (layer >= facades.x && layer <= facades.y) ? 1.0 - t.a : 0.0;
    vec3 albedo = t.rgb * t.rgb * tint;
    vec3 view = normalize(eye - p);
    vec3 normal = normalize(n);
    normal = dot(normal, view) < 0.0 ? -normal : normal;
    vec4 dirt = texture(grain, vec2(p.x + p.z, p.y) * 0.09);
    albedo *= 0.75 + 0.5 * dirt.g;
    float sun = sun_visible(p, normal) * max(dot(normal, sun_direction), 0.0);
    vec3 c = albedo * (ambient(normal) + sun_colour * sun + ego_lamps(p, normal));
    float f = fresnel(abs(dot(normal, view)), 0.08);
    vec3 bent = reflect(-view, normal) + 0.15 * (dirt.agr - 0.5);
    vec3 window = mix(street.rgb, haze.rgb * 1.5, smoothstep(-0.1, 0.25, -bent.y)) * f + albedo * 0.2;
    vec2 pane = floor(uvl.xy * 2.0);
    window += vec3(1.0, 0.75, 0.4) * lamps * step(0.62, fract(random * 7.3 + pane.x * 0.37 + pane.y * 0.71));
    c = mix(c, window, glass);
    colour = vec4(through_air(c, p), 1.0);
}
