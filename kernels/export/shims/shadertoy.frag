#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
out vec4 wamnet_written;
uniform vec3 iResolution;
uniform float iTime;
uniform int iFrame;
uniform sampler2D iChannel0;
uniform sampler2D iChannel1;
uniform sampler2D iChannel2;
uniform sampler2D iChannel3;
@kernel@
void main()
{
    mainImage(wamnet_written, gl_FragCoord.xy);
}
