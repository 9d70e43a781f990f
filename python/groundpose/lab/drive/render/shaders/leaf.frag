uniform sampler2DArray layers;
in vec3 uvl;
in vec3 lit;
in float air;
out vec4 colour;
void main() {
    vec4 t = texture(layers, uvl);
    if (t.a < 0.45) discard;
    colour = vec4(mix(haze.rgb, t.rgb * t.rgb * lit, air), 1.0);
}
