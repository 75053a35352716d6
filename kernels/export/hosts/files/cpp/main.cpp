// The denoiser in a program in C++: `make run` builds it, compares it with the reference, and draws seen.ppm.
//
// The headers are C99 and C++ alike; host.h has what differs from model to model, and calls all kernels in order.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <string>
#include <vector>

static float *host_floats(std::size_t count)
{
    return static_cast<float *>(std::calloc(count, sizeof(float)));
}

static std::vector<float> read(const std::string &path, std::size_t count)
{
    std::vector<float> numbers(count);
    std::ifstream file(path, std::ios::binary);
    if (!file.read(reinterpret_cast<char *>(numbers.data()), static_cast<std::streamsize>(count * sizeof(float)))) {
        std::cerr << path << " cannot be read: start this program in the folder of the export\n";
        std::exit(2);
    }
    return numbers;
}

static float *host_read(const char *path, std::size_t count)
{
    float *numbers = host_floats(count);
    const auto found = read(path, count);
    std::copy(found.begin(), found.end(), numbers);
    return numbers;
}

#include "host.h"

namespace {
constexpr std::size_t count = std::size_t{HOST_WIDTH} * HOST_HEIGHT;

using Images = std::vector<std::vector<float>>;

std::vector<float> denoised(Images &images, int width, int height)
{
    std::vector<float *> given;
    for (auto &image : images) {
        given.push_back(image.data());
    }
    std::vector<float> result(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * 3);
    host_denoise(given.data(), result.data(), width, height);
    return result;
}

// Two pictures side by side, each pixel `times` as large: they are encoded for the display already.
void show(const char *path, const Images &both, int width, int height, int times)
{
    std::ofstream file(path, std::ios::binary);
    file << "P6 " << 2 * width * times << ' ' << height * times << " 255\n";
    for (int y = 0; y < height * times; ++y) {
        for (int x = 0; x < 2 * width * times; ++x) {
            const auto &from = both[x < width * times ? 0 : 1];
            for (int c = 0; c < 3; ++c) {
                const int at = (y / times * width + x / times % width) * 3 + c;
                const float value = std::clamp(from[static_cast<std::size_t>(at)], 0.0f, 1.0f);
                file.put(static_cast<char>(static_cast<unsigned char>(255.0f * value + 0.5f)));
            }
        }
    }
    std::printf("%s: noisy on the left, denoised on the right\n", path);
}

bool check()
{
    Images images;
    for (const auto &image : host_images) {
        images.push_back(read(image.file, count * static_cast<std::size_t>(image.channels)));
    }
    const auto result = denoised(images, HOST_WIDTH, HOST_HEIGHT);
    const auto expected = read("check/output.f32", count * 3), bound = read("check/bound.f32", count * 3);
    float worst = 0.0f, most = 0.0f;
    int wrong = 0;
    for (std::size_t i = 0; i < result.size(); ++i) {
        const float error = std::fabs(result[i] - expected[i]), allowed = bound[i] + HOST_ADDED;
        wrong += !(error <= allowed); // written so that NaN is wrong
        worst = error <= worst ? worst : error;
        most = std::max(most, allowed);
    }
    show("seen.ppm", {images[0], result}, HOST_WIDTH, HOST_HEIGHT, 12);
    std::printf("largest error %.3g, allowed %.3g; %d of %zu numbers are wrong\n", static_cast<double>(worst),
                static_cast<double>(most), wrong, result.size());
    return wrong == 0;
}

#if defined(WAMNET_TRACE_H)
// A picture from nothing: one path a pixel for the colour, and the model's own number for the features.
void draw(int side)
{
    const std::size_t pixels = static_cast<std::size_t>(side) * static_cast<std::size_t>(side);
    std::vector<float> sums(pixels * HOST_PLANES), means(sums);
    host_trace(side, side, 0, 1, sums.data());
    host_trace(side, side, 0, HOST_RAYS, means.data());
    std::transform(means.begin() + static_cast<std::ptrdiff_t>(3 * pixels), means.end(),
                   sums.begin() + static_cast<std::ptrdiff_t>(3 * pixels), // planes 0 to 2 are the colour
                   [](float sum) { return sum / HOST_RAYS; });
    Images images;
    std::vector<float *> given;
    for (const auto &image : host_images) {
        images.emplace_back(pixels * static_cast<std::size_t>(image.channels));
        given.push_back(images.back().data());
    }
    host_encode(sums.data(), given.data(), side, side, 1);
    const auto result = denoised(images, side, side);
    show("picture.ppm", {images[0], result}, side, side, 1);
}
#else
void draw(int) {}
#endif
} // namespace

int main()
{
    const bool right = check();
    if (right) {
        draw(192);
    }
    std::puts(right ? "right" : "WRONG");
    return right ? 0 : 1;
}
