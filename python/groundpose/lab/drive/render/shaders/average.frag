// Mean over a pixel of a picture drawn finer; the brightness of glints is limited.
uniform sampler2D picture;
uniform vec2 size;           // of the picture wanted
out vec4 colour;
void main() {
    vec3 c = vec3(0.0);
    for (int i = 0; i < 4; i++) {
        vec2 part = vec2(float(i & 1), float(i >> 1)) * 0.5 - 0.25;
        c += min(textureLod(picture, (gl_FragCoord.xy + part) / size, 0.0).rgb, vec3(12.0));
    }
    colour = vec4(0.25 * c, 1.0);
}
