in vec2 q;
flat in vec4 half_size;
out vec4 colour;
void main() {
    vec2 d = abs(q) - half_size.xy;
    float outside = length(max(d, 0.0)), inside = min(max(d.x, d.y), 0.0);
    float dark = 0.85 * smoothstep(0.3, -0.45, inside + outside) + 0.35 * smoothstep(half_size.z, 0.0, outside);
    colour = vec4(vec3(1.0 - clamp(dark, 0.0, 0.93)), 1.0);
}
