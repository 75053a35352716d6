/*
 * What this export is bound to. Written by `wamnet export`: main.c is the same for every model.
 */
#ifndef HOST_H
#define HOST_H

enum { HOST_WIDTH = @width@, HOST_HEIGHT = @height@ }; /* of the check pair */

enum { HOST_SIZES = -1, HOST_COLUMNS = -2, HOST_ROWS = -3 }; /* integers: both, or one */

#define HOST_ADDED @added@f /* what the host's storage may add to a bound */

/* Numbers of a pixel, or in all; the file that a buffer holds at first, or none. */
static const struct host_buffer {
    const char *name;
    int each;
    int all;
    const char *file;
} host_buffers[] = {
@buffers@
};

enum { HOST_BUFFERS = @count@, HOST_RESULT = @result@, HOST_MOST = @most@ };

/* A kernel: pixels of an item along a row and down, items of a group; its arguments, by their places. */
static const struct host_launch {
    const char *file;
    const char *entry;
    int pixels, rows, group_x, group_y;
    int count;
    struct {
        int place;
        int buffer;
    } arguments[HOST_MOST];
} host_launches[] = {
@launches@
};

enum { HOST_LAUNCHES = @steps@ };

#endif
