#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
out vec4 wamnet_written;
uniform vec2 wamnet_size;
vec2 UV;
vec4 COLOR;
@kernel@
void main()
{
    UV = gl_FragCoord.xy / wamnet_size;
    fragment();
    wamnet_written = COLOR;
}
