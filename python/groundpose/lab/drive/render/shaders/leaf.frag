uniform sampler2DArray layers;
uniform vec2 leaves;         // first and last layer
in vec3 uvl;
in vec3 lit;
in float air;
out vec4 colour;
void main() {
    vec4 t = texture(layers, uvl);
    // Bars narrower than a pixel cover a part of the pixels in turn; leaves would seem to boil.
    // Windows of the frame begin at multiples of three.
    vec2 cell = floor(gl_FragCoord.xy);
    float bars = (3.0 * mod(cell.x + cell.y, 3.0) + mod(cell.x + 2.0 * cell.y, 3.0) + 0.5) / 9.0;
    if (t.a < (uvl.z < leaves.x || uvl.z > leaves.y ? bars : 0.45)) discard;
    colour = vec4(mix(haze.rgb, t.rgb * t.rgb * lit, air), 1.0);
}
