// Shading per pixel, or interpolated light of the vertices; number plates are textures in both.
uniform sampler2D plates;
in vec3 plate;               // place in the picture of the plates, 1 where there is one
out vec4 colour;
#ifdef CORNERS
in vec4 lit;
void main() {
    vec3 letters = texture(plates, plate.xy).rgb;
    colour = vec4(lit.rgb * mix(vec3(1.0), letters * letters, plate.z), lit.a);
}
#else
in vec3 p;
in vec3 n;
in vec3 local;
in float height;
in vec3 side;
flat in vec4 surface;
flat in vec4 kind;
flat in vec4 state;
flat in vec4 extra;
flat in vec3 shine;
void main() {
    vec4 lit = shade(Point(p, n, local, side, height, surface, kind, state, extra, shine));
    vec3 letters = texture(plates, plate.xy).rgb;
    colour = vec4(lit.rgb * mix(vec3(1.0), letters * letters, plate.z), lit.a);
}
#endif
