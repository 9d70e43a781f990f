// Depth only; leaves and fences keep their holes.
#ifdef HOLES
uniform sampler2DArray layers;
in vec3 uvl;
#endif
void main() {
#ifdef HOLES
    if (texture(layers, uvl).a < 0.4) discard;
#endif
}
