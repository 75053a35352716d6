#include <pthread.h>
static pthread_barrier_t wamnet_barrier;
static inline void wamnet_wait() { pthread_barrier_wait(&wamnet_barrier); }
