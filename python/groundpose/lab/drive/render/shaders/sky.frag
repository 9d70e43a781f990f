// Sky, and a far line of trees and roofs that hides the horizon.
uniform vec4 far_line;   // rgb, sine of its height
uniform float sky_seen;  // brightness of the visible sky relative to the light of the scene
in vec3 ray;
out vec4 colour;
void main() {
    vec3 d = normalize(ray);
    float up = -d.y;
    float az = atan(d.x, d.z) / (2.0 * PI);
    vec4 wide = textureLod(grain, vec2(az * 3.0, 0.31), 0.0), fine = textureLod(grain, vec2(az * 24.0, 0.77), 0.0);
    float line = far_line.w * (0.1 + 1.5 * wide.g * wide.b + 0.35 * fine.g);
    vec3 c = sky(d, 0.0) * sky_seen;
    vec4 leaf = textureLod(grain, vec2(az * 60.0, up * 9.0), 0.0);
    vec3 wood = far_line.rgb * (0.45 + 1.1 * leaf.g * leaf.a * 2.0);
    vec3 land = mix(wood, far_line.rgb * 1.4, smoothstep(0.0, -0.03, up));
    land = mix(haze.rgb, land, exp(-haze.w * 250.0));
    float edge = fwidth(up) + 1e-4;
    colour = vec4(mix(land, c, smoothstep(line - edge, line + edge, up)), 1.0);
}
