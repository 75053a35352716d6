extern "C" void wamnet_call(const int *sizes, float *const *buffers, int columns, int rows)
{
    for (int row = 0; row < rows; ++row) {
        for (int column = 0; column < columns; ++column) {
            WAMNET_CALL
        }
    }
}
