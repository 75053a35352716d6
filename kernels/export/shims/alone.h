static inline void wamnet_wait() {}
