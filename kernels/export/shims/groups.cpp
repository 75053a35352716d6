struct WamnetItem {
    int item, columns, rows;
    const int *sizes;
    float *const *buffers;
};

/* One item of all groups: the others of a group have ended before it goes on to the next. */
static void *wamnet_item(void *given)
{
    auto [item, columns, rows, sizes, buffers] = *(const WamnetItem *)given;
    int column = item % WAMNET_WIDTH, row = item / WAMNET_WIDTH;
    for (int group = 0; group < columns * rows; ++group) {
        int group_column = group % columns, group_row = group / columns;
        WAMNET_CALL
        wamnet_wait();
    }
    return nullptr;
}

extern "C" void wamnet_call(const int *sizes, float *const *buffers, int columns, int rows)
{
    constexpr int count = WAMNET_WIDTH * WAMNET_HEIGHT;
    pthread_t threads[count];
    WamnetItem items[count];
    pthread_barrier_init(&wamnet_barrier, nullptr, count);
    for (int item = 0; item < count; ++item) {
        items[item] = {item, columns, rows, sizes, buffers};
        if (pthread_create(&threads[item], nullptr, wamnet_item, &items[item])) {
            __builtin_trap();
        }
    }
    for (pthread_t each : threads) {
        pthread_join(each, nullptr);
    }
    pthread_barrier_destroy(&wamnet_barrier);
}
