#version 330 core
// The mean of a pixel's rays: radiance and coverage over all, depth over those that hit.
uniform sampler2D rays;
uniform int supersample;
out vec4 pixel;

void main() {
    ivec2 first = ivec2(gl_FragCoord.xy) * supersample;
    vec3 sum = vec3(0.0);
    for (int row = 0; row < supersample; row++)
        for (int column = 0; column < supersample; column++)
            sum += texelFetch(rays, first + ivec2(column, row), 0).rgb;
    float infinite = uintBitsToFloat(0x7f800000u);
    pixel = vec4(sum.rg / float(supersample * supersample), sum.g > 0.0 ? sum.b / sum.g : infinite, 0.0);
}
