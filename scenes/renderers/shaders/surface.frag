#version 330 core
// Lambert's law in linear light; the texture is read at the level of scenes/renderers/pyramid.py.
uniform sampler2D albedo;
uniform float sharper;
uniform float levels;
uniform vec3 towards_lamp;
uniform vec3 light;  // ambient, intensity, emission
in vec3 world_normal;
in vec2 uv;
in float distance_along_axis;
out vec4 ray;  // radiance, 1, depth

void main() {
    vec2 size = vec2(textureSize(albedo, 0));
    vec2 across = dFdx(uv) * size, down = dFdy(uv) * size;
    float longest = max(sqrt(max(dot(across, across), dot(down, down))), 1e-30);
    float side = max(abs(across.x * down.y - across.y * down.x) / longest, longest / 2.0);
    float level = clamp(log2(side) + sharper, 0.0, levels - 1.0);
    float cosine = dot(world_normal, towards_lamp) / max(length(world_normal), 1e-30);
    float reflected = textureLod(albedo, uv, level).r * (light.x + light.y * max(0.0, cosine));
    ray = vec4(reflected + light.z, 1.0, distance_along_axis, 0.0);
}
