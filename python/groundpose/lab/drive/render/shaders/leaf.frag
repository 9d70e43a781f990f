uniform sampler2DArray layers;
uniform vec2 leaves;         // first and last layer
in vec3 uvl;
in vec3 lit;
in float air;
out vec4 colour;
void main() {
    vec4 t = texture(layers, uvl);
    // Bars narrower than a pixel cover a part of the pixels in turn; leaves would seem to boil.
    vec2 cell = mod(floor(gl_FragCoord.xy), 2.0);
    float bars = 0.125 + 0.25 * mod(2.0 * cell.x + 3.0 * cell.y, 4.0);
    if (t.a < (uvl.z < leaves.x || uvl.z > leaves.y ? bars : 0.45)) discard;
    colour = vec4(mix(haze.rgb, t.rgb * t.rgb * lit, air), 1.0);
}
