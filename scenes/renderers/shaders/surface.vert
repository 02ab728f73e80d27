#version 330 core
// A surface: to the camera, to the window; normals to the world.
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 texcoord;
uniform mat4 to_camera;
uniform mat4 to_window;
uniform mat3 to_world;
out vec3 world_normal;
out vec2 uv;
out float distance_along_axis;

void main() {
    vec4 seen = to_camera * vec4(position, 1.0);
    gl_Position = to_window * seen;
    world_normal = to_world * normal;
    uv = texcoord;
    distance_along_axis = -seen.z;
}
