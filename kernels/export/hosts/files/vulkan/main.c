/*
 * The denoiser on Vulkan 1.0: `make run` builds this, compares it with the reference, and draws seen.ppm.
 *
 * 1. A device with a queue for computation, one pool of memory that this program can see, and all buffers in it.
 * 2. host.h has the buffers and the launches of this model: each launch is a pipeline and a set of descriptors.
 * 3. All launches are one list of commands; a barrier lets each one see what those before it have written.
 */
#include "common.h"
#include <vulkan/vulkan.h>

static VkDevice device;

static void check(VkResult error, const char *what)
{
    if (error) {
        fprintf(stderr, "%s: Vulkan's error %d\n", what, error);
        exit(2);
    }
}

/* A device, and the family of queues on it that compute. */
static VkPhysicalDevice open_device(uint32_t *family)
{
    VkApplicationInfo program = {.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO, .apiVersion = VK_API_VERSION_1_0};
    VkInstanceCreateInfo wanted = {.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO, .pApplicationInfo = &program};
    VkInstance instance;
    VkPhysicalDevice physical;
    VkPhysicalDeviceProperties properties;
    VkQueueFamilyProperties families[16];
    uint32_t count = 1, kinds = 16;
    float first = 1.0f;
    check(vkCreateInstance(&wanted, NULL, &instance), "an instance");
    if (vkEnumeratePhysicalDevices(instance, &count, &physical) < 0 || count == 0) {
        host_stop("no device: install a driver, such as mesa-vulkan-drivers", "Vulkan");
    }
    vkGetPhysicalDeviceProperties(physical, &properties);
    printf("Vulkan, %s\n", properties.deviceName);
    vkGetPhysicalDeviceQueueFamilyProperties(physical, &kinds, families);
    for (*family = 0; *family + 1 < kinds && !(families[*family].queueFlags & VK_QUEUE_COMPUTE_BIT); ++*family) {
    }
    VkDeviceQueueCreateInfo queue = {
        .sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
        .queueFamilyIndex = *family,
        .queueCount = 1,
        .pQueuePriorities = &first,
    };
    VkDeviceCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
        .queueCreateInfoCount = 1,
        .pQueueCreateInfos = &queue,
    };
    check(vkCreateDevice(physical, &info, NULL, &device), "a device");
    return physical;
}

/* A buffer with memory that this program sees at `*seen`, filled with `data` if there is any. */
static VkBuffer buffer_of(VkPhysicalDevice physical, size_t size, const void *data, VkBufferUsageFlags kind, void **seen)
{
    const VkMemoryPropertyFlags visible = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    VkBufferCreateInfo info = {.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO, .size = size, .usage = kind};
    VkPhysicalDeviceMemoryProperties all;
    VkMemoryRequirements needs;
    VkDeviceMemory memory;
    VkBuffer buffer;
    check(vkCreateBuffer(device, &info, NULL, &buffer), "a buffer");
    vkGetBufferMemoryRequirements(device, buffer, &needs);
    vkGetPhysicalDeviceMemoryProperties(physical, &all);
    uint32_t type = 0;
    while (!(needs.memoryTypeBits >> type & 1u) || (all.memoryTypes[type].propertyFlags & visible) != visible) {
        ++type; /* Vulkan promises that there is one */
    }
    VkMemoryAllocateInfo amount = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO,
        .allocationSize = needs.size,
        .memoryTypeIndex = type,
    };
    check(vkAllocateMemory(device, &amount, NULL, &memory), "memory");
    check(vkBindBufferMemory(device, buffer, memory, 0), "memory");
    check(vkMapMemory(device, memory, 0, VK_WHOLE_SIZE, 0, seen), "memory");
    if (data) {
        memcpy(*seen, data, size);
    }
    return buffer;
}

/* The layout of a launch's set: a block of sizes, and buffers. */
static VkDescriptorSetLayout layout_of(const struct host_launch *launch)
{
    VkDescriptorSetLayoutBinding bindings[HOST_MOST];
    VkDescriptorSetLayout layout;
    memset(bindings, 0, sizeof bindings);
    for (int i = 0; i < launch->count; ++i) {
        int is_sizes = launch->arguments[i].buffer == HOST_SIZES;
        bindings[i].binding = (uint32_t)launch->arguments[i].place;
        bindings[i].descriptorType = is_sizes ? VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
        bindings[i].descriptorCount = 1;
        bindings[i].stageFlags = VK_SHADER_STAGE_COMPUTE_BIT;
    }
    VkDescriptorSetLayoutCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO,
        .bindingCount = (uint32_t)launch->count,
        .pBindings = bindings,
    };
    check(vkCreateDescriptorSetLayout(device, &info, NULL, &layout), "a layout");
    return layout;
}

/* The set of a launch: what its bindings are. */
static VkDescriptorSet set_of(
    const struct host_launch *launch, VkDescriptorSetLayout layout, VkBuffer sizes, const VkBuffer *buffers)
{
    VkDescriptorPoolSize kinds[2] = {{VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, 1}, {VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, HOST_MOST}};
    VkDescriptorPoolCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO,
        .maxSets = 1,
        .poolSizeCount = 2,
        .pPoolSizes = kinds,
    };
    VkDescriptorPool pool;
    VkDescriptorSet set;
    check(vkCreateDescriptorPool(device, &info, NULL, &pool), "a pool of descriptors");
    VkDescriptorSetAllocateInfo one = {
        .sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO,
        .descriptorPool = pool,
        .descriptorSetCount = 1,
        .pSetLayouts = &layout,
    };
    check(vkAllocateDescriptorSets(device, &one, &set), "a set of descriptors");
    for (int i = 0; i < launch->count; ++i) {
        int what = launch->arguments[i].buffer;
        VkDescriptorBufferInfo whole = {what == HOST_SIZES ? sizes : buffers[what], 0, VK_WHOLE_SIZE};
        VkWriteDescriptorSet written = {
            .sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET,
            .dstSet = set,
            .dstBinding = (uint32_t)launch->arguments[i].place,
            .descriptorCount = 1,
            .descriptorType =
                what == HOST_SIZES ? VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER,
            .pBufferInfo = &whole,
        };
        vkUpdateDescriptorSets(device, 1, &written, 0, NULL);
    }
    return set;
}

/* A launch as commands. */
static void record(
    VkCommandBuffer commands, const struct host_launch *launch, VkBuffer sizes, const VkBuffer *buffers)
{
    VkDescriptorSetLayout layout = layout_of(launch);
    VkDescriptorSet set = set_of(launch, layout, sizes, buffers);
    size_t size;
    const char *code = host_file(launch->file, &size);
    VkShaderModuleCreateInfo text = {
        .sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO,
        .codeSize = size,
        .pCode = (const uint32_t *)(const void *)code,
    };
    VkPipelineLayoutCreateInfo sets = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO,
        .setLayoutCount = 1,
        .pSetLayouts = &layout,
    };
    VkComputePipelineCreateInfo info = {.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO};
    VkPipeline pipeline;
    info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
    info.stage.pName = launch->entry;
    check(vkCreateShaderModule(device, &text, NULL, &info.stage.module), launch->file);
    check(vkCreatePipelineLayout(device, &sets, NULL, &info.layout), launch->file);
    check(vkCreateComputePipelines(device, VK_NULL_HANDLE, 1, &info, NULL, &pipeline), launch->file);
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, info.layout, 0, 1, &set, 0, NULL);
    vkCmdDispatch(
        commands,
        host_groups(HOST_WIDTH, launch->pixels, launch->group_x),
        host_groups(HOST_HEIGHT, launch->rows, launch->group_y),
        1);
    VkMemoryBarrier barrier = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER,
        .srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT,
        .dstAccessMask = VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_HOST_READ_BIT,
    };
    VkPipelineStageFlags after = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_HOST_BIT;
    vkCmdPipelineBarrier(
        commands, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, after, 0, 1, &barrier, 0, NULL, 0, NULL);
}

int main(void)
{
    uint32_t family;
    VkPhysicalDevice physical = open_device(&family);
    VkBuffer buffers[HOST_BUFFERS], sizes;
    void *seen[HOST_BUFFERS], *unused;
    const int32_t numbers[4] = {HOST_WIDTH, HOST_HEIGHT, 0, 0};
    for (int i = 0; i < HOST_BUFFERS; ++i) {
        float *data = host_buffers[i].file ? host_read(host_buffers[i].file, host_numbers(i)) : NULL;
        size_t size = host_numbers(i) * sizeof *data;
        buffers[i] = buffer_of(physical, size, data, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, &seen[i]);
        free(data);
    }
    sizes = buffer_of(physical, sizeof numbers, numbers, VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT, &unused);
    VkCommandPoolCreateInfo kind = {.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, .queueFamilyIndex = family};
    VkCommandPool pool;
    check(vkCreateCommandPool(device, &kind, NULL, &pool), "a pool of commands");
    VkCommandBufferAllocateInfo one = {
        .sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
        .commandPool = pool,
        .commandBufferCount = 1,
    };
    VkCommandBuffer commands;
    check(vkAllocateCommandBuffers(device, &one, &commands), "commands");
    VkCommandBufferBeginInfo begin = {.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    check(vkBeginCommandBuffer(commands, &begin), "commands");
    for (int i = 0; i < HOST_LAUNCHES; ++i) {
        record(commands, &host_launches[i], sizes, buffers);
    }
    check(vkEndCommandBuffer(commands), "commands");
    VkSubmitInfo submitted = {
        .sType = VK_STRUCTURE_TYPE_SUBMIT_INFO,
        .commandBufferCount = 1,
        .pCommandBuffers = &commands,
    };
    VkQueue queue;
    vkGetDeviceQueue(device, family, 0, &queue);
    check(vkQueueSubmit(queue, 1, &submitted, VK_NULL_HANDLE), "the queue");
    check(vkQueueWaitIdle(queue), "the queue");
    return host_judge((const float *)seen[HOST_RESULT]);
}
