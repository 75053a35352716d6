extern "C" void wamnet_call(const int *sizes, float *const *buffers, int columns, int rows)
{
    for (int group = 0; group < columns * rows; ++group) {
        int group_column = group % columns, group_row = group / columns;
        std::barrier<> barrier(WAMNET_WIDTH * WAMNET_HEIGHT);
        wamnet_barrier = &barrier;
        std::vector<std::thread> items;
        for (int item = 0; item < WAMNET_WIDTH * WAMNET_HEIGHT; ++item) {
            items.emplace_back([&barrier, item, group_column, group_row, sizes, buffers] {
                int column = item % WAMNET_WIDTH, row = item / WAMNET_WIDTH;
                WAMNET_CALL
                barrier.arrive_and_drop();
            });
        }
        for (std::thread &each : items) {
            each.join();
        }
    }
}
