// Eye coordinates are in units of the view's radius; z is towards the eye.
layout(location = 0) in vec3 position;
uniform vec3 u_scale;
out vec3 p;

void main() {
  p = position;
  gl_Position = vec4(position * u_scale, 1.0);
}
