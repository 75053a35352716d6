/* Paths by Embree 3: what one would write by hand in C with the usual library for rays, as a peer.

   1. A scene is read from a file [read_scene]; boxes are triangles, walls, quads and lamps Embree's quads,
      spheres its spheres [make_scene].
   2. LANES neighbouring pixels are followed together: one call finds what all their rays meet, one whether
      lamps are hidden [follow]. All else is loops over the lanes, which the compiler turns into vectors.
   3. Transport is that of refimpl/light/transport.py for matte scenes: a lamp and a direction are sampled at
      each surface, and weighted by the power heuristic; no Russian roulette.
   4. For each line "samples seed" of the input the picture (height, width, 3) is written as float32.

   Embree: Wald et al., "Embree: A Kernel Framework for Efficient CPU Ray Tracing", ACM TOG 33 (4), 2014. */
#include <embree3/rtcore.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LANES = 16, COUNTS = 8, LIGHT = 20, SURFACE = 7 };
#define PI 3.14159265f
#define NEAR 1e-4f  /* a ray starts so far from its surface, in scene units */
#define EACH for (int i = 0; i < LANES; i++)

/* Counts: width, height, edges of a path, boxes, quads (walls and lamps too), spheres, lamps, surfaces.
   Then float32: camera position, right, up, forward (3 each), tangent of half the field of view; background
   (3); low and high corner of the room that a camera outside looks into (3 each); for each box 8 corners, for
   each quad 4, for each sphere centre and radius; for each surface reflectance, emission, lamp or -1; for each
   lamp corner, edges, normal, radiance (3 each), area, probability, sum of the probabilities, 2 unused. */
static int32_t count[COUNTS];
static float camera[13], background[3], room[6];
static float *surface, *light;
static uint32_t first[3]; /* the first surface of boxes, quads, spheres */
static RTCScene scene;

static void need(int holds, const char *what) {
    if (!holds) {
        fprintf(stderr, "embree_paths: %s\n", what);
        exit(2);
    }
}

static float *numbers(FILE *file, size_t n) {
    float *found = malloc((n + 1) * sizeof *found);
    need(found && fread(found, sizeof *found, n, file) == n, "the scene's file is cut");
    return found;
}

static void attach(RTCDevice device, RTCGeometry geometry, unsigned id) {
    rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_HIGH);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene, geometry, id);
    rtcReleaseGeometry(geometry);
    need(rtcGetDeviceError(device) == RTC_ERROR_NONE, "Embree refuses a shape");
}

/* A mesh of n bodies with `corners` corners each and faces of `sides` corners. */
static void mesh(RTCDevice device, FILE *file, unsigned id, int n, int corners, const int *face, int faces, int sides) {
    if (n == 0) return;
    RTCGeometry made = rtcNewGeometry(device, sides == 3 ? RTC_GEOMETRY_TYPE_TRIANGLE : RTC_GEOMETRY_TYPE_QUAD);
    float *place = rtcSetNewGeometryBuffer(made, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, (size_t)n * corners);
    float *given = numbers(file, (size_t)n * corners * 3);
    memcpy(place, given, (size_t)n * corners * 12);
    free(given);
    enum RTCFormat format = sides == 3 ? RTC_FORMAT_UINT3 : RTC_FORMAT_UINT4;
    unsigned *index = rtcSetNewGeometryBuffer(made, RTC_BUFFER_TYPE_INDEX, 0, format, 4 * sides, (size_t)n * faces);
    for (int body = 0; body < n; body++)
        for (int k = 0; k < faces * sides; k++) *index++ = (unsigned)(body * corners + face[k]);
    attach(device, made, id);
}

static void make_scene(RTCDevice device, FILE *file) {
    /* Corner k of a box has bit 0 for x, bit 1 for y, bit 2 for z. */
    static const int box[36] = {0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1,
                                2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3};
    static const int quad[4] = {0, 1, 2, 3};
    scene = rtcNewScene(device);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    mesh(device, file, 0, count[3], 8, box, 12, 3);
    mesh(device, file, 1, count[4], 4, quad, 1, 4);
    if (count[5] > 0) {
        RTCGeometry made = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_SPHERE_POINT);
        float *place = rtcSetNewGeometryBuffer(made, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 16, count[5]);
        float *given = numbers(file, 4 * (size_t)count[5]);
        memcpy(place, given, 16 * (size_t)count[5]);
        free(given);
        attach(device, made, 2);
    }
    rtcCommitScene(scene);
    first[1] = count[3], first[2] = count[3] + count[4];
}

static void read_scene(RTCDevice device, const char *path) {
    FILE *file = fopen(path, "rb");
    need(file && fread(count, 4, COUNTS, file) == COUNTS, "the scene's file does not open");
    float *head = numbers(file, 22);
    memcpy(camera, head, sizeof camera);
    memcpy(background, head + 13, sizeof background);
    memcpy(room, head + 16, sizeof room);
    free(head);
    make_scene(device, file);
    surface = numbers(file, (size_t)SURFACE * count[7]);
    light = numbers(file, (size_t)LIGHT * count[6]);
    fclose(file);
}

/* ---- one packet of paths -------------------------------------------------------------------------------- */

typedef struct {
    float d[3][LANES], beta[3][LANES], sum[3][LANES], pdf[LANES];
    uint32_t random[LANES];
    int valid[LANES];
} Paths;

static inline uint32_t mixed(uint32_t x) { /* PCG's output function: O'Neill, 2014 */
    x = x * 747796405u + 2891336453u;
    x = ((x >> ((x >> 28) + 4u)) ^ x) * 277803737u;
    return (x >> 22) ^ x;
}

static inline float uniform(uint32_t *state) {
    *state = *state * 747796405u + 2891336453u;
    uint32_t x = ((*state >> ((*state >> 28) + 4u)) ^ *state) * 277803737u;
    return (float)(((x >> 22) ^ x) >> 8) * 0x1p-24f;
}

static void leave_camera(Paths *p, struct RTCRay16 *ray, int x, int y, uint32_t seed, uint32_t sample) {
    const float *c = camera;
    for (int i = 0; i < LANES; i++) {
        int column = x + i < count[0] ? x + i : count[0] - 1;
        p->valid[i] = x + i < count[0] ? -1 : 0;
        p->random[i] = mixed(mixed(mixed(seed) ^ (uint32_t)(y * count[0] + column)) + sample);
        float u = (2.0f * (column + uniform(&p->random[i])) - count[0]) / count[1] * c[12];
        float v = (count[1] - 2.0f * (y + uniform(&p->random[i]))) / count[1] * c[12];
        float d[3], square = 0.0f, from = 0.0f, to = 1e30f;
        for (int k = 0; k < 3; k++) d[k] = c[9 + k] + u * c[3 + k] + v * c[6 + k], square += d[k] * d[k];
        float scale = 1.0f / sqrtf(square);
        for (int k = 0; k < 3; k++) { /* where the ray enters the room */
            d[k] *= scale;
            float a = (room[k] - c[k]) / d[k], b = (room[3 + k] - c[k]) / d[k];
            from = fmaxf(from, fminf(a, b)), to = fminf(to, fmaxf(a, b));
            p->d[k][i] = d[k], p->beta[k][i] = 1.0f;
        }
        p->pdf[i] = -1.0f; /* not a sample: what it meets counts in full */
        ray->org_x[i] = c[0], ray->org_y[i] = c[1], ray->org_z[i] = c[2];
        ray->tnear[i] = from <= to && from > 0.0f ? from * (1.0f + NEAR) : 0.0f;
    }
}

static void intersect(Paths *p, struct RTCRayHit16 *hit, int coherent) {
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    EACH {
        hit->ray.dir_x[i] = p->d[0][i], hit->ray.dir_y[i] = p->d[1][i], hit->ray.dir_z[i] = p->d[2][i];
        hit->ray.tfar[i] = 1e30f, hit->ray.time[i] = 0.0f, hit->ray.mask[i] = ~0u, hit->ray.flags[i] = 0;
        hit->hit.geomID[i] = hit->hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    rtcIntersect16(p->valid, scene, &context, hit);
}

/* Add what the surfaces emit, sample a lamp and a direction; shadow rays and their light go into dark, lit. */
static int scatter(Paths *p, struct RTCRayHit16 *hit, int last, struct RTCRay16 *dark, float lit[3][LANES], int *asked) {
    int any = 0;
    for (int i = 0; i < LANES; i++) {
        asked[i] = 0;
        if (!p->valid[i]) continue;
        unsigned geometry = hit->hit.geomID[i], primitive = hit->hit.primID[i];
        if (geometry == RTC_INVALID_GEOMETRY_ID) {
            for (int k = 0; k < 3; k++) p->sum[k][i] += p->beta[k][i] * background[k];
            p->valid[i] = 0;
            continue;
        }
        const float *s = surface + SURFACE * (first[geometry] + (geometry == 0 ? primitive / 12 : primitive));
        float n[3] = {hit->hit.Ng_x[i], hit->hit.Ng_y[i], hit->hit.Ng_z[i]}, t = hit->ray.tfar[i];
        float d[3] = {p->d[0][i], p->d[1][i], p->d[2][i]};
        float scale = 1.0f / sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        if (n[0] * d[0] + n[1] * d[1] + n[2] * d[2] > 0.0f) scale = -scale;
        for (int k = 0; k < 3; k++) n[k] *= scale;
        float weight = 1.0f;
        if (s[6] >= 0.0f) {
            const float *l = light + LIGHT * (int)s[6];
            float cosine = -(l[9] * d[0] + l[10] * d[1] + l[11] * d[2]);
            float other = l[16] * t * t / (fmaxf(cosine, 1e-15f) * l[15]), own = p->pdf[i];
            weight = cosine <= 0.0f ? 0.0f : own < 0.0f ? 1.0f : own * own / (own * own + other * other);
        }
        for (int k = 0; k < 3; k++) p->sum[k][i] += p->beta[k][i] * s[3 + k] * weight;
        if (last || s[0] + s[1] + s[2] == 0.0f) {
            p->valid[i] = 0;
            continue;
        }
        float x[3] = {hit->ray.org_x[i] + t * d[0], hit->ray.org_y[i] + t * d[1], hit->ray.org_z[i] + t * d[2]};
        float pick = uniform(&p->random[i]), a = uniform(&p->random[i]), b = uniform(&p->random[i]);
        int k = 0;
        while (k + 1 < count[6] && pick >= light[LIGHT * k + 17]) k++;
        if (count[6] > 0) {
            const float *l = light + LIGHT * k;
            float w[3], square = 0.0f;
            for (int j = 0; j < 3; j++) w[j] = l[j] + a * l[3 + j] + b * l[6 + j] - x[j], square += w[j] * w[j];
            float distance = sqrtf(square);
            for (int j = 0; j < 3; j++) w[j] /= distance;
            float cosine = n[0] * w[0] + n[1] * w[1] + n[2] * w[2];
            float its = -(l[9] * w[0] + l[10] * w[1] + l[11] * w[2]);
            if (cosine > 0.0f && its > 0.0f) {
                float pdf = l[16] * square / (its * l[15]), own = cosine / PI;
                float factor = own * (pdf / (pdf * pdf + own * own));
                for (int j = 0; j < 3; j++) lit[j][i] = p->beta[j][i] * s[j] * l[12 + j] * factor;
                dark->org_x[i] = x[0], dark->org_y[i] = x[1], dark->org_z[i] = x[2];
                dark->dir_x[i] = w[0], dark->dir_y[i] = w[1], dark->dir_z[i] = w[2];
                dark->tnear[i] = NEAR, dark->tfar[i] = distance - 2.0f * NEAR;
                dark->time[i] = 0.0f, dark->mask[i] = ~0u, dark->flags[i] = 0;
                asked[i] = -1;
            }
        }
        float u = uniform(&p->random[i]), v = 2.0f * PI * uniform(&p->random[i]);
        float sign = copysignf(1.0f, n[2]), f = -1.0f / (sign + n[2]), g = n[0] * n[1] * f; /* Duff et al., 2017 */
        float r = sqrtf(u), z = sqrtf(1.0f - u), rx = r * cosf(v), ry = r * sinf(v);
        p->d[0][i] = rx * (1.0f + sign * n[0] * n[0] * f) + ry * g + z * n[0];
        p->d[1][i] = rx * sign * g + ry * (sign + n[1] * n[1] * f) + z * n[1];
        p->d[2][i] = -rx * sign * n[0] - ry * n[1] + z * n[2];
        p->pdf[i] = z / PI;
        for (int j = 0; j < 3; j++) p->beta[j][i] *= s[j];
        hit->ray.org_x[i] = x[0], hit->ray.org_y[i] = x[1], hit->ray.org_z[i] = x[2], hit->ray.tnear[i] = NEAR;
        any = 1;
    }
    return any;
}

static void follow(Paths *p, struct RTCRayHit16 *hit) {
    struct RTCRay16 dark;
    struct RTCIntersectContext context;
    float lit[3][LANES];
    int asked[LANES];
    for (int edge = 0, any = 1; any && edge < count[2]; edge++) {
        intersect(p, hit, edge == 0);
        any = scatter(p, hit, edge + 1 == count[2], &dark, lit, asked);
        rtcInitIntersectContext(&context);
        if (any) rtcOccluded16(asked, scene, &context, &dark);
        EACH if (asked[i] && dark.tfar[i] >= 0.0f)
            for (int k = 0; k < 3; k++) p->sum[k][i] += lit[k][i];
    }
}

static void render(float *picture, int samples, uint32_t seed) {
    #pragma omp parallel for schedule(dynamic, 1)
    for (int y = 0; y < count[1]; y++)
        for (int x = 0; x < count[0]; x += LANES) {
            Paths paths;
            struct RTCRayHit16 hit;
            memset(paths.sum, 0, sizeof paths.sum);
            for (int sample = 0; sample < samples; sample++) {
                leave_camera(&paths, &hit.ray, x, y, seed, (uint32_t)sample);
                follow(&paths, &hit);
            }
            for (int i = 0; i < LANES && x + i < count[0]; i++)
                for (int k = 0; k < 3; k++)
                    picture[3 * ((size_t)y * count[0] + x + i) + k] = paths.sum[k][i] / samples;
        }
}

int main(int arguments, char **given) {
    need(arguments == 2, "one argument: the scene's file");
    RTCDevice device = rtcNewDevice(NULL);
    need(device != NULL, "Embree has no device");
    read_scene(device, given[1]);
    size_t size = 3 * (size_t)count[0] * count[1];
    float *picture = calloc(size, sizeof *picture);
    int samples;
    uint32_t seed;
    while (picture && scanf("%d %u", &samples, &seed) == 2) {
        render(picture, samples, seed);
        need(fwrite(picture, sizeof *picture, size, stdout) == size && fflush(stdout) == 0, "nobody reads");
    }
    return 0;
}
