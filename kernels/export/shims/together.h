#include <barrier>
#include <thread>
#include <vector>
static std::barrier<> *wamnet_barrier;
static inline void wamnet_wait() { wamnet_barrier->arrive_and_wait(); }
