/*
 * @all@ of @source@, for threads with small stacks. Generated.
 *
 * @all@ takes up to @stack@ bytes of the calling thread's stack.
 * @all@_with runs it on a thread whose stack is `scratch`, and waits for its end: give it
 * @prefix@_scratch_bytes() bytes that no other call uses meanwhile. It returns 0; EINVAL, with nothing written, for
 * fewer `scratch_bytes`; or the error of pthread_create.
 *
 * POSIX threads. With -std=c99, define _POSIX_C_SOURCE as 200809L before the first header; link with -pthread.
 */
#ifndef @guard@
#define @guard@
#include <errno.h>
#include <pthread.h>
#include <stddef.h>
#include <stdint.h>
#include "@source@"

typedef struct {
@fields@
} @prefix@_call;

static inline size_t @prefix@_scratch_bytes(void)
{
    return @bytes@;
}

static inline void *@prefix@_run(void *given)
{
    const @prefix@_call *call = (const @prefix@_call *)given;
    @all@(@passed@);
    return 0;
}

static inline int @all@_with(
@parameters@,
    void *scratch,
    size_t scratch_bytes)
{
    const uintptr_t page = @page@, start = ((uintptr_t)scratch + page - 1) / page * page;
    @prefix@_call call = {@arguments@
    };
    pthread_attr_t attributes;
    pthread_t thread;
    int error;
    if (scratch_bytes < @prefix@_scratch_bytes()) {
        return EINVAL;
    }
    error = pthread_attr_init(&attributes);
    if (error) {
        return error;
    }
    error = pthread_attr_setstack(&attributes, (void *)start, @prefix@_scratch_bytes() - page);
    if (!error) {
        error = pthread_create(&thread, &attributes, @prefix@_run, &call);
    }
    pthread_attr_destroy(&attributes);
    return error ? error : pthread_join(thread, 0);
}
#endif
