/* A second implementation of the spec, in C99, in one file, with the standard library alone.
 *
 * It shares no code with wamnet: it was written from the text in spec/ and from the pages of the vectors. Each
 * function names the clauses that it follows. It answers on standard output what spec/conformance.md asks on
 * standard input:
 *
 *     cc -std=c99 -O2 -o wamnet-c99 wamnet.c -lm
 *     wamnet conformance --program ./wamnet-c99
 *
 * All arithmetic is in double precision, rounded to single where a clause says so. What is invalid is refused:
 * [refuse] leaves the request by longjmp, and all memory of a request is freed at its end [get].
 *
 * Sections: memory and refusal, JSON, numbers in requests, answers, SHA-256 and base64, vectors, random numbers,
 * sampling, scenes, intersection, materials, the sky, light transport, images, network, networks of
 * integers, metrics, model files, kinds, protocol.
 */
#include <errno.h>
#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef __GNUC__
#define NORETURN __attribute__((noreturn, format(printf, 1, 2)))
#else
#define NORETURN
#endif

static const double PI = 3.14159265358979323846;

/* ---- memory and refusal --------------------------------------------------------------------------------- */

typedef struct block block;
struct block {
    block *next;
    double aligned[1];
};

static block *blocks;
static jmp_buf way_out;
static char reason[256];

/* Leave the request: its input is invalid, for this reason (CNF-9). */
static void refuse(const char *format, ...) NORETURN;
static void refuse(const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(reason, sizeof reason, format, arguments);
    va_end(arguments);
    longjmp(way_out, 1);
}

/* Return zeroed memory for count items, which lives as long as the request. */
static void *get(size_t count, size_t size) {
    if (size && count > (SIZE_MAX - sizeof(block)) / size) refuse("it is too large");
    block *made = calloc(1, sizeof(block) + count * size);
    if (!made) refuse("there is no memory for it");
    made->next = blocks;
    blocks = made;
    return made->aligned;
}

static void free_all(void) {
    while (blocks) {
        block *next = blocks->next;
        free(blocks);
        blocks = next;
    }
}

/* A text that grows. */
typedef struct {
    char *text;
    size_t length, room;
} buffer;

static void put_bytes(buffer *to, const char *bytes, size_t length) {
    if (to->room - to->length <= length) {
        size_t room = 2 * to->room + length + 64;
        char *text = get(room, 1);
        if (to->length) memcpy(text, to->text, to->length);
        to->text = text;
        to->room = room;
    }
    if (length) memcpy(to->text + to->length, bytes, length);
    to->length += length;
    to->text[to->length] = 0;
}

static void put(buffer *to, const char *text) { put_bytes(to, text, strlen(text)); }

/* ---- JSON ----------------------------------------------------------------------------------------------- */

typedef enum { J_NULL, J_FALSE, J_TRUE, J_NUMBER, J_TEXT, J_LIST, J_OBJECT } json_type;

typedef struct json json;
struct json {
    json_type type;
    bool whole;    /* a number without fraction and exponent */
    double number;
    char *text;    /* of a text, with a 0 after its end */
    size_t length; /* of the text in bytes, or the number of items */
    json **items;  /* of a list, or the values of an object */
    json **names;  /* of an object */
};

typedef struct {
    const char *at, *end;
    int depth;
} parser;

enum { DEEPEST = 64 };

static json *parse_value(parser *p);

static void skip_space(parser *p) {
    while (p->at < p->end && (*p->at == ' ' || *p->at == '\t' || *p->at == '\n' || *p->at == '\r')) p->at++;
}

static bool next_is(parser *p, char c) {
    skip_space(p);
    if (p->at == p->end || *p->at != c) return false;
    p->at++;
    return true;
}

/* Refuse what is not UTF-8: overlong forms, surrogates and what lies beyond 0x10ffff are not. */
static void check_utf8(const char *text, size_t length) {
    const unsigned char *s = (const unsigned char *)text, *end = s + length;
    while (s < end) {
        unsigned c = *s++, more = c < 0x80 ? 0 : c >> 5 == 6 ? 1 : c >> 4 == 14 ? 2 : c >> 3 == 30 ? 3 : 9;
        if (more == 9 || (size_t)(end - s) < more) refuse("it is not UTF-8");
        unsigned long code = more ? c & (0x3fu >> more) : c;
        for (unsigned i = 0; i < more; i++) {
            if (*s >> 6 != 2) refuse("it is not UTF-8");
            code = code << 6 | (*s++ & 0x3fu);
        }
        static const unsigned long least[] = {0, 0x80, 0x800, 0x10000};
        if (code < least[more] || code > 0x10ffff || (code >= 0xd800 && code < 0xe000)) refuse("it is not UTF-8");
    }
}

static void put_utf8(buffer *to, unsigned long code) {
    char c[4];
    size_t n = code < 0x80 ? 1 : code < 0x800 ? 2 : code < 0x10000 ? 3 : 4;
    static const unsigned long marks[] = {0, 0, 0xc0, 0xe0, 0xf0};
    for (size_t i = n; i-- > 1; code >>= 6) c[i] = (char)(0x80 | (code & 0x3f));
    c[0] = (char)(marks[n] | code);
    put_bytes(to, c, n);
}

static unsigned long parse_hex4(parser *p) {
    unsigned long code = 0;
    for (int i = 0; i < 4; i++) {
        char c = p->at < p->end ? *p->at++ : 0;
        int digit = c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10
                  : c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
        if (digit < 0) refuse("no JSON: \\u needs four hexadecimal digits");
        code = code * 16 + (unsigned long)digit;
    }
    return code;
}

/* Halves of a character that stand alone are refused: they cannot be written as UTF-8. */
static unsigned long parse_code(parser *p) {
    unsigned long code = parse_hex4(p);
    if (code < 0xd800 || code >= 0xe000) return code;
    if (code >= 0xdc00 || p->end - p->at < 2 || p->at[0] != '\\' || p->at[1] != 'u') refuse("half a character");
    p->at += 2;
    unsigned long low = parse_hex4(p);
    if (low < 0xdc00 || low >= 0xe000) refuse("half a character");
    return 0x10000 + ((code - 0xd800) << 10) + (low - 0xdc00);
}

static json *parse_text(parser *p) {
    buffer text = {0};
    put(&text, "");
    for (;;) {
        const char *start = p->at;
        while (p->at < p->end && *p->at != '"' && *p->at != '\\' && (unsigned char)*p->at >= 0x20) p->at++;
        put_bytes(&text, start, (size_t)(p->at - start));
        if (p->at == p->end || (unsigned char)*p->at < 0x20) refuse("no JSON: a text does not end");
        if (*p->at++ == '"') break;
        char c = p->at < p->end ? *p->at++ : 0;
        const char *from = "\"\\/bfnrt", *to = "\"\\/\b\f\n\r\t", *found = c ? strchr(from, c) : NULL;
        if (c == 'u') put_utf8(&text, parse_code(p));
        else if (found) put_bytes(&text, to + (found - from), 1);
        else refuse("no JSON: an unknown escape");
    }
    json *made = get(1, sizeof *made);
    made->type = J_TEXT;
    made->text = text.text;
    made->length = text.length;
    return made;
}

static void skip_digits(parser *p) {
    const char *start = p->at;
    while (p->at < p->end && *p->at >= '0' && *p->at <= '9') p->at++;
    if (p->at == start) refuse("no JSON: a digit is missing");
}

static json *parse_number(parser *p) {
    const char *start = p->at;
    json *made = get(1, sizeof *made);
    made->type = J_NUMBER;
    made->whole = true;
    if (p->at < p->end && *p->at == '-') p->at++;
    if (p->at < p->end && *p->at == '0') p->at++;
    else skip_digits(p);
    if (p->at < p->end && *p->at == '.') {
        made->whole = false;
        p->at++;
        skip_digits(p);
    }
    if (p->at < p->end && (*p->at == 'e' || *p->at == 'E')) {
        made->whole = false;
        p->at++;
        if (p->at < p->end && (*p->at == '+' || *p->at == '-')) p->at++;
        skip_digits(p);
    }
    if (p->at - start > 1000) refuse("no JSON: a number of more than 1,000 characters");
    char *copy = get((size_t)(p->at - start) + 1, 1);
    memcpy(copy, start, (size_t)(p->at - start));
    made->number = strtod(copy, NULL);
    if (made->whole && made->number == 0) made->number = 0; /* integers have one zero */
    return made;
}

static void append(json *to, json *name, json *item) {
    if ((to->length & (to->length - 1)) == 0) { /* full at 0 and at powers of two */
        size_t room = to->length ? 2 * to->length : 1;
        json **items = get(room, sizeof *items), **names = get(room, sizeof *names);
        if (to->length) memcpy(items, to->items, to->length * sizeof *items);
        if (to->length) memcpy(names, to->names, to->length * sizeof *names);
        to->items = items;
        to->names = names;
    }
    to->names[to->length] = name;
    to->items[to->length++] = item;
}

static bool same_text(const json *a, const json *b) {
    return a->length == b->length && !memcmp(a->text, b->text, a->length);
}

static json *parse_list(parser *p, bool object) {
    json *made = get(1, sizeof *made);
    made->type = object ? J_OBJECT : J_LIST;
    char close = object ? '}' : ']';
    if (++p->depth > DEEPEST) refuse("it is nested too deeply");
    if (!next_is(p, close)) {
        do {
            json *name = NULL;
            if (object) {
                if (!next_is(p, '"')) refuse("no JSON: a name is missing");
                name = parse_text(p);
                if (!next_is(p, ':')) refuse("no JSON: a colon is missing");
            }
            if (object)
                for (size_t i = 0; i < made->length; i++)
                    if (same_text(made->names[i], name)) refuse("the name %.80s stands there twice", name->text);
            append(made, name, parse_value(p));
        } while (next_is(p, ','));
        if (!next_is(p, close)) refuse("no JSON: a bracket is not closed");
    }
    p->depth--;
    return made;
}

static json *parse_word(parser *p) {
    static const char *const words[] = {"null", "false", "true"};
    for (int i = 0; i < 3; i++) {
        size_t n = strlen(words[i]);
        if ((size_t)(p->end - p->at) >= n && !memcmp(p->at, words[i], n)) {
            json *made = get(1, sizeof *made);
            made->type = (json_type)i;
            p->at += n;
            return made;
        }
    }
    refuse("no JSON: an unknown word");
}

static json *parse_value(parser *p) {
    skip_space(p);
    if (p->at == p->end) refuse("no JSON: it ends too early");
    if (next_is(p, '{')) return parse_list(p, true);
    if (next_is(p, '[')) return parse_list(p, false);
    if (next_is(p, '"')) return parse_text(p);
    return *p->at == '-' || (*p->at >= '0' && *p->at <= '9') ? parse_number(p) : parse_word(p);
}

static json *parse(const char *text, size_t length) {
    parser p = {text, text + length, 0};
    check_utf8(text, length);
    json *made = parse_value(&p);
    skip_space(&p);
    if (p.at != p.end) refuse("no JSON: there is more after its end");
    return made;
}

/* Return the value of that name, or nothing. */
static json *find(const json *in, const char *name) {
    if (in->type != J_OBJECT) refuse("an object is expected");
    for (size_t i = in->length; i-- > 0;)
        if (in->names[i]->length == strlen(name) && !strcmp(in->names[i]->text, name)) return in->items[i];
    return NULL;
}

static json *field(const json *in, const char *name) {
    json *found = find(in, name);
    if (!found) refuse("%s is missing", name);
    return found;
}

/* ---- numbers in requests: CNF-2, CNF-5 ------------------------------------------------------------------ */

static double number_of(const json *from) {
    if (from->type == J_NUMBER) return from->number;
    char *end = NULL;
    double found = from->type == J_TEXT ? strtod(from->text, &end) : 0;
    if (!end || end == from->text || *end) refuse("a number is expected");
    return found;
}

static double number(const json *in, const char *name) { return number_of(field(in, name)); }

static double whole_of(const json *from, double least, double most, const char *name) {
    if (from->type != J_NUMBER || !from->whole || !(from->number >= least) || !(from->number <= most))
        refuse("%s must be an integer from %.0f to %.0f", name, least, most);
    return from->number;
}

static uint32_t counter(const json *in, const char *name) {
    return (uint32_t)whole_of(field(in, name), 0, 4294967295.0, name);
}

static const char *text_of(const json *from, const char *name) {
    if (from->type != J_TEXT || strlen(from->text) != from->length) refuse("%s must be a text", name);
    return from->text;
}

static const char *text(const json *in, const char *name) { return text_of(field(in, name), name); }

enum { AXES = 4 };

/* Numbers with up to four axes, in C order. */
typedef struct {
    int axes;
    size_t shape[AXES], count;
    double *values;
} array;

static array new_array(int axes, const size_t *shape) {
    array made = {.axes = axes, .count = 1};
    for (int i = 0; i < axes; i++) {
        made.shape[i] = shape[i];
        if (shape[i] && made.count > SIZE_MAX / shape[i]) refuse("it is too large");
        made.count *= shape[i];
    }
    made.values = get(made.count, sizeof(double));
    return made;
}

static void fill(const json *from, const array *to, int axis, double **next) {
    if (axis == to->axes) {
        *(*next)++ = number_of(from);
        return;
    }
    if (from->type != J_LIST || from->length != to->shape[axis]) refuse("lists must be of one length");
    for (size_t i = 0; i < from->length; i++) fill(from->items[i], to, axis + 1, next);
}

static char *read_file(const char *path, size_t *length) {
    buffer content = {0};
    char piece[4096];
    FILE *file = fopen(path, "rb");
    if (!file) refuse("%.200s cannot be opened", path);
    put(&content, "");
    for (size_t n; (n = fread(piece, 1, sizeof piece, file)) > 0;) put_bytes(&content, piece, n);
    fclose(file);
    *length = content.length;
    return content.text;
}

static float little_endian_float(const unsigned char *b) {
    uint32_t bits = b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24;
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static array array_of_file(const json *from) {
    size_t shape[AXES], length;
    const json *sides = field(from, "shape");
    if (sides->type != J_LIST || sides->length > AXES) refuse("a shape has at most four sides");
    for (size_t i = 0; i < sides->length; i++) shape[i] = (size_t)whole_of(sides->items[i], 0, 1e9, "a side");
    char *content = read_file(text(from, "file"), &length);
    if (length % 4) refuse("a file of float32 has a multiple of four bytes");
    size_t count = 1;
    for (size_t i = 0; i < sides->length; i++)
        if (shape[i] && (count *= shape[i]) > length) refuse("the file is shorter than its shape says");
    array made = new_array((int)sides->length, shape);
    if (made.count != length / 4) refuse("the file does not have the shape that it should have");
    for (size_t i = 0; i < made.count; i++)
        made.values[i] = little_endian_float((const unsigned char *)content + 4 * i);
    return made;
}

static array array_of(const json *from, int axes) {
    array made;
    if (from->type == J_OBJECT) {
        made = array_of_file(from);
    } else {
        size_t shape[AXES] = {0};
        const json *inner = from;
        int found = 0;
        for (; inner->type == J_LIST && found < AXES; found++) {
            shape[found] = inner->length;
            if (!inner->length) {
                found++;
                break;
            }
            inner = inner->items[0];
        }
        made = new_array(found, shape);
        double *next = made.values;
        if (made.count) fill(from, &made, 0, &next);
    }
    if (made.axes != axes) refuse("numbers in %d axes, not %d, are expected", axes, made.axes);
    return made;
}

static array array_in(const json *in, const char *name, int axes) { return array_of(field(in, name), axes); }

/* ---- answers: CNF-9 ------------------------------------------------------------------------------------- */

static buffer answer;

/* Write a text as JSON; what is not ASCII as \u with four hexadecimal digits, halves of characters included. */
static void put_json_text(buffer *to, const char *bytes, size_t length) {
    const unsigned char *s = (const unsigned char *)bytes, *end = s + length;
    char made[32];
    put(to, "\"");
    while (s < end) {
        unsigned long code = *s++;
        unsigned more = code < 0x80 ? 0 : code < 0xe0 ? 1 : code < 0xf0 ? 2 : 3;
        const char *from = "\"\\\b\f\n\r\t", *names = "\"\\bfnrt", *found = code ? strchr(from, (int)code) : NULL;
        if (more) code &= 0x3fu >> more;
        for (; more; more--) code = code << 6 | (*s++ & 0x3fu);
        if (code < 0x80 && found) snprintf(made, sizeof made, "\\%c", names[found - from]);
        else if (code >= 0x20 && code < 0x7f) snprintf(made, sizeof made, "%c", (int)code);
        else if (code < 0x10000) snprintf(made, sizeof made, "\\u%04lx", code);
        else
            snprintf(made, sizeof made, "\\u%04lx\\u%04lx", 0xd800 + ((code - 0x10000) >> 10),
                     0xdc00 + ((code - 0x10000) & 0x3ff));
        put(to, made);
    }
    put(to, "\"");
}

static void open_output(const char *name) {
    if (answer.text[answer.length - 1] != '{') put(&answer, ", ");
    put_json_text(&answer, name, strlen(name));
    put(&answer, ": ");
}

/* Numbers are written so that nothing is lost (CNF-2). */
static void put_number(double x) {
    char made[48];
    if (isnan(x)) snprintf(made, sizeof made, "\"nan\"");
    else if (isinf(x)) snprintf(made, sizeof made, x > 0 ? "\"inf\"" : "\"-inf\"");
    else snprintf(made, sizeof made, "\"%a\"", x);
    put(&answer, made);
}

static void put_array(const array *from, int axis, const double **next) {
    if (axis == from->axes) {
        put_number(*(*next)++);
        return;
    }
    put(&answer, "[");
    for (size_t i = 0; i < from->shape[axis]; i++) {
        if (i) put(&answer, ", ");
        put_array(from, axis + 1, next);
    }
    put(&answer, "]");
}

static void answer_array(const char *name, array values) {
    const double *next = values.values;
    open_output(name);
    put_array(&values, 0, &next);
}

static void answer_number(const char *name, double x) {
    open_output(name);
    put_number(x);
}

static void answer_wholes(const char *name, const uint32_t *values, size_t count) {
    char made[16];
    open_output(name);
    for (size_t i = 0; i < count; i++) {
        snprintf(made, sizeof made, "%s%lu", i ? ", " : "[", (unsigned long)values[i]);
        put(&answer, made);
    }
    put(&answer, count ? "]" : "[]");
}

static void answer_whole(const char *name, uint32_t value) {
    char made[16];
    open_output(name);
    snprintf(made, sizeof made, "%lu", (unsigned long)value);
    put(&answer, made);
}

static void answer_text(const char *name, const char *value) {
    open_output(name);
    put_json_text(&answer, value, strlen(value));
}

/* ---- SHA-256 (FIPS 180-4) and base64 (RFC 4648) --------------------------------------------------------- */

static uint32_t rotated(uint32_t x, int n) { return x >> n | x << (32 - n); }

/* The constants are the first 32 bits of the fractions of roots of primes: square roots of the first eight for
 * the start, cube roots of the first 64 for the rounds. Here they are found by halving an interval. */
static uint32_t root_fraction(unsigned prime, int degree) {
    uint64_t low = 0, high = (uint64_t)1 << 36; /* the root times 2^32, below 8 2^32 */
    while (low + 1 < high) {
        uint64_t middle = low + (high - low) / 2;
        long double root = (long double)middle / 4294967296.0L;
        if ((degree == 2 ? root * root : root * root * root) <= (long double)prime) low = middle;
        else high = middle;
    }
    return (uint32_t)low;
}

typedef struct {
    uint32_t state[8], rounds[64];
} sha;

static void sha_start(sha *s) {
    int found = 0;
    for (unsigned n = 2; found < 64; n++) {
        bool prime = true;
        for (unsigned d = 2; d * d <= n; d++) prime = prime && n % d;
        if (!prime) continue;
        if (found < 8) s->state[found] = root_fraction(n, 2);
        s->rounds[found++] = root_fraction(n, 3);
    }
}

static void sha_block(sha *s, const unsigned char *b) {
    uint32_t w[64], v[8];
    for (int i = 0; i < 16; i++, b += 4)
        w[i] = (uint32_t)b[0] << 24 | (uint32_t)b[1] << 16 | (uint32_t)b[2] << 8 | b[3];
    for (int i = 16; i < 64; i++)
        w[i] = w[i - 16] + (rotated(w[i - 15], 7) ^ rotated(w[i - 15], 18) ^ w[i - 15] >> 3) + w[i - 7]
             + (rotated(w[i - 2], 17) ^ rotated(w[i - 2], 19) ^ w[i - 2] >> 10);
    memcpy(v, s->state, sizeof v);
    for (int i = 0; i < 64; i++) {
        uint32_t one = v[7] + (rotated(v[4], 6) ^ rotated(v[4], 11) ^ rotated(v[4], 25))
                     + ((v[4] & v[5]) ^ (~v[4] & v[6])) + s->rounds[i] + w[i];
        uint32_t two = (rotated(v[0], 2) ^ rotated(v[0], 13) ^ rotated(v[0], 22))
                     + ((v[0] & v[1]) ^ (v[0] & v[2]) ^ (v[1] & v[2]));
        memmove(v + 1, v, 7 * sizeof *v);
        v[4] += one;
        v[0] = one + two;
    }
    for (int i = 0; i < 8; i++) s->state[i] += v[i];
}

static const char *sha256(const unsigned char *content, size_t length) {
    sha s;
    unsigned char last[128] = {0};
    size_t full = length / 64 * 64, rest = length - full, padded = rest < 56 ? 64 : 128;
    char *made = get(65, 1);
    sha_start(&s);
    for (size_t i = 0; i < full; i += 64) sha_block(&s, content + i);
    if (rest) memcpy(last, content + full, rest);
    last[rest] = 0x80;
    for (int i = 0; i < 8; i++) last[padded - 1 - (size_t)i] = (unsigned char)((uint64_t)length * 8 >> 8 * i);
    for (size_t i = 0; i < padded; i += 64) sha_block(&s, last + i);
    for (int i = 0; i < 8; i++) snprintf(made + 8 * i, 9, "%08lx", (unsigned long)s.state[i]);
    return made;
}

static unsigned char *from_base64(const char *from, size_t *length) {
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    size_t count = strlen(from), pads = 0;
    while (pads < 2 && pads < count && from[count - 1 - pads] == '=') pads++;
    if (count % 4) refuse("base64 has a multiple of four letters");
    unsigned char *made = get(count / 4 * 3 + 1, 1);
    *length = count / 4 * 3 - pads;
    for (size_t i = 0; i < count; i += 4) {
        unsigned long word = 0;
        for (size_t k = i; k < i + 4; k++) {
            const char *found = k < count - pads ? strchr(digits, from[k]) : digits;
            if (!found) refuse("it is not base64");
            word = word << 6 | (unsigned long)(found - digits);
        }
        for (size_t k = 0; k < 3; k++) made[i / 4 * 3 + k] = (unsigned char)(word >> (16 - 8 * k));
    }
    return made;
}

/* ---- vectors: VEC-1 to VEC-4 ---------------------------------------------------------------------------- */

typedef struct {
    double c[3];
} v3;

static v3 vec(double x, double y, double z) { return (v3){{x, y, z}}; }
static v3 add(v3 a, v3 b) { return vec(a.c[0] + b.c[0], a.c[1] + b.c[1], a.c[2] + b.c[2]); }
static v3 sub(v3 a, v3 b) { return vec(a.c[0] - b.c[0], a.c[1] - b.c[1], a.c[2] - b.c[2]); }
static v3 mul(v3 a, v3 b) { return vec(a.c[0] * b.c[0], a.c[1] * b.c[1], a.c[2] * b.c[2]); }
static v3 scale(v3 a, double s) { return vec(a.c[0] * s, a.c[1] * s, a.c[2] * s); }
static double dot(v3 a, v3 b) { return a.c[0] * b.c[0] + a.c[1] * b.c[1] + a.c[2] * b.c[2]; }
static double length(v3 a) { return sqrt(dot(a, a)); }
static v3 divided(v3 a, double s) { return vec(a.c[0] / s, a.c[1] / s, a.c[2] / s); }
static v3 unit(v3 a) { return divided(a, length(a)); } /* VEC-3 */
static double sum(v3 a) { return a.c[0] + a.c[1] + a.c[2]; }
static double largest(v3 a) { return fmax(a.c[0], fmax(a.c[1], a.c[2])); }

static v3 cross(v3 a, v3 b) {
    return vec(a.c[1] * b.c[2] - a.c[2] * b.c[1], a.c[2] * b.c[0] - a.c[0] * b.c[2],
               a.c[0] * b.c[1] - a.c[1] * b.c[0]);
}

static double clamp(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

static v3 vec_of(array from) {
    if (from.count != 3) refuse("three numbers are expected");
    return vec(from.values[0], from.values[1], from.values[2]);
}

static v3 vec_in(const json *in, const char *name) { return vec_of(array_in(in, name, 1)); }

static void answer_vec(const char *name, v3 value) {
    answer_array(name, (array){.axes = 1, .shape = {3}, .count = 3, .values = value.c});
}

/* ---- random numbers: RNG and SOB ------------------------------------------------------------------------ */

typedef struct {
    uint32_t w[4];
} words;

/* RNG-1, RNG-2 */
static words pcg4d(words v) {
    for (int i = 0; i < 4; i++) v.w[i] = v.w[i] * 1664525u + 1013904223u;
    for (int round = 0; round < 2; round++) {
        v.w[0] += v.w[1] * v.w[3];
        v.w[1] += v.w[2] * v.w[0];
        v.w[2] += v.w[0] * v.w[1];
        v.w[3] += v.w[1] * v.w[2];
        for (int i = 0; i < 4 && !round; i++) v.w[i] ^= v.w[i] >> 16;
    }
    return v;
}

/* RNG-3 */
static words random_block(uint32_t seed, uint32_t pixel, uint32_t sample, uint32_t b) {
    return pcg4d((words){{pixel, sample, b, seed}});
}

/* RNG-5 */
static double uniform(uint32_t word) { return (double)(word >> 8) / 16777216.0; }

static uint32_t reversed(uint32_t x) {
    uint32_t made = 0;
    for (int i = 0; i < 32; i++) made |= (x >> i & 1u) << (31 - i);
    return made;
}

/* SOB-2 */
static uint32_t scrambled(uint32_t x, uint32_t key) {
    static const uint32_t factors[4] = {0x6c50b47c, 0xb82f1e52, 0xc7afe638, 0x8d22f6e6};
    x = reversed(x) + key;
    for (int i = 0; i < 4; i++) x ^= x * factors[i];
    return reversed(x);
}

/* SOB-1: with the recurrence m_k = 2 a_1 m_(k-1) ^ ... ^ 2^s m_(k-s) ^ m_(k-s) of a polynomial of degree s. */
static uint32_t sobol(uint32_t index, int dimension) {
    static const int degrees[4] = {0, 1, 2, 3}, coefficients[4] = {0, 0, 1, 1};
    static const uint32_t first[4][3] = {{0}, {1}, {1, 3}, {1, 3, 1}};
    uint32_t m[32], point = 0;
    int s = degrees[dimension];
    for (int k = 0; k < 32; k++) {
        m[k] = s == 0 ? 1 : k < s ? first[dimension][k] : m[k - s] ^ m[k - s] << s;
        for (int j = 1; k >= s && j < s; j++)
            if (coefficients[dimension] >> (s - 1 - j) & 1) m[k] ^= m[k - j] << j;
        if (index >> k & 1) point ^= m[k] << (31 - k);
    }
    return point;
}

/* SOB-3 */
static words sobol_block(uint32_t seed, uint32_t pixel, uint32_t sample, uint32_t b) {
    uint32_t order = random_block(seed, pixel, 0xffffffffu, b).w[0];
    words keys = random_block(seed, pixel, 0xfffffffeu, b), made;
    for (int d = 0; d < 4; d++) made.w[d] = scrambled(sobol(scrambled(sample, order), d), keys.w[d]);
    return made;
}

/* SOB-5 */
static words net_words(uint32_t seed, uint32_t pixel, uint32_t sample, uint32_t b) {
    words made = random_block(seed, pixel, 0, b);
    for (int d = 0; d < 2; d++) {
        uint32_t key = made.w[2 + d];
        made.w[d] ^= scrambled(sobol(sample, d), key) ^ scrambled(0, key);
    }
    return made;
}

/* ---- sampling: SMP -------------------------------------------------------------------------------------- */

/* SMP-1 */
static void concentric_disk(double u0, double u1, double *x, double *y) {
    double a = 2 * u0 - 1, b = 2 * u1 - 1, r, phi;
    if (fabs(a) > fabs(b)) {
        r = a;
        phi = PI / 4 * (b / a);
    } else {
        r = b;
        phi = PI / 2 - PI / 4 * (b == 0 ? 0 : a / b);
    }
    *x = r * cos(phi);
    *y = r * sin(phi);
}

/* SMP-2 */
static v3 cosine_hemisphere(double u0, double u1) {
    double x, y;
    concentric_disk(u0, u1, &x, &y);
    return vec(x, y, sqrt(fmax(0, 1 - x * x - y * y)));
}

/* SMP-3 */
static v3 quad_point(double u0, double u1, v3 corner, v3 edge_u, v3 edge_v) {
    return add(corner, add(scale(edge_u, u0), scale(edge_v, u1)));
}

/* SMP-4 */
static size_t discrete(double u, const double *sums, size_t count) {
    size_t index = 0;
    for (size_t i = 0; i + 1 < count; i++) index += sums[i] <= u;
    return index;
}

static double discrete_probability(size_t index, const double *sums) {
    return index ? sums[index] - sums[index - 1] : sums[0];
}

/* SMP-5 */
static void tangents(v3 n, v3 *t, v3 *other) {
    double s = n.c[2] < 0 ? -1 : 1, a = -1 / (s + n.c[2]), b = n.c[0] * n.c[1] * a;
    *t = vec(1 + s * n.c[0] * n.c[0] * a, s * b, -s * n.c[0]);
    *other = vec(b, s + n.c[1] * n.c[1] * a, -n.c[1]);
}

/* SMP-6 */
static v3 to_world(v3 local, v3 n) {
    v3 t, other;
    tangents(n, &t, &other);
    return add(add(scale(t, local.c[0]), scale(other, local.c[1])), scale(n, local.c[2]));
}

static v3 to_local(v3 w, v3 n) {
    v3 t, other;
    tangents(n, &t, &other);
    return vec(dot(w, t), dot(w, other), dot(w, n));
}

/* SMP-7 */
static v3 spherical_cauchy(double u0, double u1, double k) {
    double versine = 2 * u0 / (1 + 2 * k * (1 - u0)), phi = (2 * u1 - 1) * PI;
    double sine = sqrt(fmax(0, versine * (2 - versine)));
    return vec(sine * cos(phi), sine * sin(phi), 1 - versine);
}

static double spherical_cauchy_pdf(double versine, double k) {
    double skirt = 1 + k * versine;
    return (1 + 2 * k) / (4 * PI * skirt * skirt);
}

/* ---- scenes: SCN ---------------------------------------------------------------------------------------- */

typedef enum { LAMBERTIAN, MIRROR, CONDUCTOR, DIELECTRIC } material_kind;

typedef struct {
    bool given;
    material_kind kind;
    double value; /* roughness or index */
} material;

typedef struct {
    v3 position, look_at, up;
    double fov;
} camera;

typedef struct {
    bool given;
    v3 low, high, reflectances[6], emission;
    size_t material_count;
    material materials[6];
} room;

/* A box, sphere, quad or light: each uses some of the fields. */
typedef struct {
    v3 center, half, rotation[3];
    double radius;
    v3 corner, edge_u, edge_v;
    v3 reflectance, emission;
    material made_of;
    v3 color;
    double power;
} part;

typedef struct {
    part *items;
    size_t count;
} parts;

typedef struct {
    bool given;
    v3 zenith, horizon, ground, sun_direction, sun_irradiance;
    double concentration;
} sky;

typedef struct {
    const json *name;
    camera eye;
    room walls;
    parts boxes, spheres, quads, lights;
    v3 background;
    sky above;
} scene;

#define LEAST_NUMBER 4.9406564584124654e-324 /* above 0 */

static const v3 BLACK = {{0, 0, 0}}, UP = {{0, 1, 0}};

/* SCN-6: unknown keys are refused. `known` has a space around each. */
static void check_keys(const json *in, const char *known) {
    if (in->type != J_OBJECT) refuse("an object is expected");
    for (size_t i = 0; i < in->length; i++) {
        const char *key = in->names[i]->text, *found = known;
        size_t n = strlen(key);
        while (n && (found = strstr(found, key)) && !(found[-1] == ' ' && found[n] == ' ')) found++;
        if (!n || !found || n != in->names[i]->length || strchr(key, ' ')) refuse("%.80s is no key that is known", key);
    }
}

/* SCN-7: numbers are finite and at most 1e12 in magnitude. */
static double scene_number(const json *from) {
    if (from->type != J_NUMBER || !(fabs(from->number) <= 1e12)) refuse("a number of at most 1e12 is expected");
    return from->number;
}

static double scene_number_in(const json *in, const char *name, const double *otherwise) {
    const json *found = find(in, name);
    if (!found && !otherwise) refuse("%s is missing", name);
    return found ? scene_number(found) : *otherwise;
}

static const json *list_of(const json *from, size_t length, const char *name) {
    if (from->type != J_LIST || (length != SIZE_MAX && from->length != length)) refuse("%s must be a list", name);
    return from;
}

static v3 scene_vec_of(const json *from, const char *name) {
    list_of(from, 3, name);
    return vec(scene_number(from->items[0]), scene_number(from->items[1]), scene_number(from->items[2]));
}

static v3 scene_vec(const json *in, const char *name, const v3 *otherwise) {
    const json *found = find(in, name);
    if (!found && !otherwise) refuse("%s is missing", name);
    return found ? scene_vec_of(found, name) : *otherwise;
}

static void check_range(v3 value, double least, double most, const char *name) {
    for (int i = 0; i < 3; i++)
        if (!(value.c[i] >= least && value.c[i] <= most)) refuse("%s is outside its range", name);
}

/* SCN-4, MIR-1, CDR-1, DIE-1: kinds, and the ranges of their numbers. */
static material read_material(const json *from, bool has_inside) {
    static const char *const kinds[] = {"lambertian", "mirror", "conductor", "dielectric"};
    static const double usual[] = {0, 0, 0.2, 1.5}, least[] = {0, 0, 0.001, 1}, most[] = {0, 0, 1, 4};
    material made = {0};
    if (!from || from->type == J_NULL) return made;
    const char *kind = text(from, "kind");
    int k = 0;
    while (k < 4 && strcmp(kind, kinds[k])) k++;
    if (k == 4) refuse("%.80s is no material", kind);
    check_keys(from, k == CONDUCTOR ? " kind roughness " : k == DIELECTRIC ? " kind ior " : " kind ");
    made = (material){true, (material_kind)k, 0};
    if (k >= CONDUCTOR) made.value = scene_number_in(from, k == CONDUCTOR ? "roughness" : "ior", &usual[k]);
    if (!(made.value >= least[k] && made.value <= most[k])) refuse("the material's number is outside its range");
    if (k == DIELECTRIC && !has_inside) refuse("glass must be a box or a sphere");
    return made;
}

/* SCN-7: the sine between edges must exceed 1e-6. */
static bool span_area(v3 a, v3 b) { return length(cross(a, b)) > 1e-6 * length(a) * length(b); }

static camera read_camera(const json *from) {
    static const double usual = 40;
    check_keys(from, " position look_at up vertical_fov_deg ");
    camera made = {scene_vec(from, "position", NULL), scene_vec(from, "look_at", NULL),
                   scene_vec(from, "up", &UP), scene_number_in(from, "vertical_fov_deg", &usual)};
    v3 forward = sub(made.look_at, made.position);
    if (!(made.fov > 0 && made.fov < 180)) refuse("the angle of view must lie between 0 and 180 degrees");
    if (length(forward) == 0 || !span_area(forward, made.up)) refuse("the camera sees nothing");
    return made;
}

static room read_room(const json *from) {
    room made = {0};
    if (!from || from->type == J_NULL) return made;
    check_keys(from, " low high reflectances emission materials ");
    made.given = true;
    made.low = scene_vec(from, "low", NULL);
    made.high = scene_vec(from, "high", NULL);
    made.emission = scene_vec(from, "emission", &BLACK);
    check_range(made.emission, 0, DBL_MAX, "emission");
    const json *list = list_of(field(from, "reflectances"), 6, "reflectances");
    for (int i = 0; i < 6; i++) {
        made.reflectances[i] = scene_vec_of(list->items[i], "a reflectance");
        check_range(made.reflectances[i], 0, 1, "a reflectance");
    }
    for (int i = 0; i < 3; i++)
        if (!(made.low.c[i] < made.high.c[i])) refuse("the room is inside out");
    const json *materials = find(from, "materials");
    if (materials) made.material_count = list_of(materials, SIZE_MAX, "materials")->length;
    if (made.material_count && made.material_count != 6) refuse("materials must be six or none");
    for (size_t i = 0; i < made.material_count; i++)
        made.materials[i] = read_material(materials->items[i], false);
    return made;
}

static void read_rotation(const json *from, part *made) {
    for (int i = 0; i < 3; i++) made->rotation[i].c[i] = 1;
    if (!from) return;
    list_of(from, 3, "rotation");
    for (int i = 0; i < 3; i++) made->rotation[i] = scene_vec_of(from->items[i], "a row");
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            if (!(fabs(dot(made->rotation[i], made->rotation[k]) - (i == k)) <= 1e-6)) refuse("no rotation");
    if (!(dot(cross(made->rotation[0], made->rotation[1]), made->rotation[2]) > 0)) refuse("a mirrored rotation");
}

typedef enum { BOX, SPHERE, QUAD, LIGHT } part_kind;

static part read_part(const json *from, part_kind kind) {
    static const char *const keys[] = {" center half_extent reflectance rotation emission material ",
                                       " center radius reflectance emission material ",
                                       " corner edge_u edge_v reflectance emission material ",
                                       " corner edge_u edge_v color power "};
    part made = {.radius = 0};
    check_keys(from, keys[kind]);
    if (kind == BOX || kind == SPHERE) made.center = scene_vec(from, "center", NULL);
    if (kind == BOX) {
        made.half = scene_vec(from, "half_extent", NULL);
        check_range(made.half, LEAST_NUMBER, DBL_MAX, "half_extent");
        read_rotation(find(from, "rotation"), &made);
    }
    if (kind == SPHERE && !((made.radius = scene_number_in(from, "radius", NULL)) > 0)) refuse("no radius");
    if (kind == QUAD || kind == LIGHT) {
        made.corner = scene_vec(from, "corner", NULL);
        made.edge_u = scene_vec(from, "edge_u", NULL);
        made.edge_v = scene_vec(from, "edge_v", NULL);
        if (!span_area(made.edge_u, made.edge_v)) refuse("the edges span no area");
    }
    if (kind == LIGHT) {
        made.color = scene_vec(from, "color", NULL);
        check_range(made.color, 0, DBL_MAX, "color");
        if (!((made.power = scene_number_in(from, "power", NULL)) >= 0)) refuse("power is negative");
    } else {
        made.reflectance = scene_vec(from, "reflectance", NULL);
        check_range(made.reflectance, 0, 1, "reflectance");
        made.emission = scene_vec(from, "emission", &BLACK);
        check_range(made.emission, 0, DBL_MAX, "emission");
        made.made_of = read_material(find(from, "material"), kind != QUAD);
    }
    return made;
}

static parts read_parts(const json *in, const char *name, part_kind kind) {
    parts made = {0};
    const json *list = find(in, name);
    if (!list) return made;
    made.count = list_of(list, SIZE_MAX, name)->length;
    made.items = get(made.count, sizeof *made.items);
    for (size_t i = 0; i < made.count; i++) made.items[i] = read_part(list->items[i], kind);
    return made;
}

/* SCN-9 */
static sky read_sky(const json *from, v3 background) {
    static const double usual = 1000;
    sky made = {0};
    if (!from || from->type == J_NULL) return made;
    check_keys(from, " zenith horizon ground sun_direction sun_irradiance sun_concentration ");
    made = (sky){true, scene_vec(from, "zenith", NULL), scene_vec(from, "horizon", NULL),
                 scene_vec(from, "ground", NULL), scene_vec(from, "sun_direction", &UP),
                 scene_vec(from, "sun_irradiance", &BLACK),
                 scene_number_in(from, "sun_concentration", &usual)};
    check_range(made.zenith, 0, DBL_MAX, "zenith");
    check_range(made.horizon, 0, DBL_MAX, "horizon");
    check_range(made.ground, 0, DBL_MAX, "ground");
    check_range(made.sun_irradiance, 0, DBL_MAX, "sun_irradiance");
    if (length(made.sun_direction) == 0) refuse("the sun has no direction");
    if (!(made.concentration >= 0 && made.concentration <= 1e6)) refuse("sun_concentration is outside its range");
    if (largest(background) > 0) refuse("a sky takes the background's place");
    return made;
}

/* SCN-6, SCN-7 */
static scene read_scene(const char *content, size_t length) {
    const json *from = parse(content, length);
    check_keys(from, " format version name camera room boxes spheres quads lights background environment info ");
    if (strcmp(text(from, "format"), "wamnet-scene")) refuse("format must be wamnet-scene");
    const json *version = field(from, "version");
    if (version->type != J_NUMBER || version->number != 1) refuse("version must be 1");
    scene made = {.name = field(from, "name")};
    const json *background = find(from, "background"), *info = find(from, "info");
    if (made.name->type != J_TEXT) refuse("name must be a text");
    if (info && info->type != J_OBJECT) refuse("info must be an object");
    for (size_t i = 0; info && i < info->length; i++)
        if (info->items[i]->type != J_TEXT) refuse("info must map texts to texts");
    made.eye = read_camera(field(from, "camera"));
    made.walls = read_room(find(from, "room"));
    made.boxes = read_parts(from, "boxes", BOX);
    made.spheres = read_parts(from, "spheres", SPHERE);
    made.quads = read_parts(from, "quads", QUAD);
    made.lights = read_parts(from, "lights", LIGHT);
    made.background = background ? scene_vec_of(background, "background") : BLACK;
    check_range(made.background, 0, DBL_MAX, "background");
    made.above = read_sky(find(from, "environment"), made.background);
    return made;
}

/* SCN-6: the shortest decimal that gives the same double; with an exponent below 1e-4 and from 1e16 on. */
static void put_shortest(buffer *to, double x) {
    char made[40], digits[24], *e;
    int n = 0;
    do snprintf(made, sizeof made, "%.*e", n, x);
    while (n++ < 17 && strtod(made, NULL) != x);
    e = strchr(made, 'e');
    int exponent = atoi(e + 1);
    if (exponent < -4 || exponent >= 16) {
        snprintf(digits, sizeof digits, "e%c%02d", exponent < 0 ? '-' : '+', abs(exponent));
        *e = 0;
        put(to, made);
        put(to, digits);
    } else {
        int decimals = (int)(e - made) - (made[0] == '-') - 2 - exponent; /* of d.ddd, or of d alone */
        if (!strchr(made, '.')) decimals = -exponent;
        snprintf(made, sizeof made, "%.*f", decimals > 1 ? decimals : 1, x);
        put(to, made);
    }
}

static void put_scene_vec(buffer *to, const char *name, v3 value) {
    put(to, name);
    for (int i = 0; i < 3; i++) {
        put(to, i ? ", " : "[");
        put_shortest(to, value.c[i]);
    }
    put(to, "]");
}

static void put_material(buffer *to, const char *name, material m) {
    if (!m.given && *name) return; /* SCN-6: left out where there is none */
    put(to, name);
    if (!m.given) put(to, "null");
    else if (m.kind == LAMBERTIAN) put(to, "{\"kind\": \"lambertian\"}");
    else if (m.kind == MIRROR) put(to, "{\"kind\": \"mirror\"}");
    else {
        if (m.kind == CONDUCTOR) put(to, "{\"kind\": \"conductor\", \"roughness\": ");
        else put(to, "{\"kind\": \"dielectric\", \"ior\": ");
        put_shortest(to, m.value);
        put(to, "}");
    }
}

static void put_part(buffer *to, const part *p, part_kind kind) {
    if (kind == BOX || kind == SPHERE) put_scene_vec(to, "{\"center\": ", p->center);
    if (kind == BOX) put_scene_vec(to, ", \"half_extent\": ", p->half);
    if (kind == SPHERE) {
        put(to, ", \"radius\": ");
        put_shortest(to, p->radius);
    }
    if (kind == QUAD || kind == LIGHT) {
        put_scene_vec(to, "{\"corner\": ", p->corner);
        put_scene_vec(to, ", \"edge_u\": ", p->edge_u);
        put_scene_vec(to, ", \"edge_v\": ", p->edge_v);
    }
    if (kind == LIGHT) {
        put_scene_vec(to, ", \"color\": ", p->color);
        put(to, ", \"power\": ");
        put_shortest(to, p->power);
    } else {
        put_scene_vec(to, ", \"reflectance\": ", p->reflectance);
        for (int i = 0; i < 3 && kind == BOX; i++)
            put_scene_vec(to, i ? ", " : ", \"rotation\": [", p->rotation[i]);
        if (kind == BOX) put(to, "]");
        put_scene_vec(to, ", \"emission\": ", p->emission);
        put_material(to, ", \"material\": ", p->made_of);
    }
    put(to, "}");
}

static void put_parts(buffer *to, const char *name, parts list, part_kind kind) {
    put(to, name);
    for (size_t i = 0; i < list.count; i++) {
        if (i) put(to, ", ");
        put_part(to, &list.items[i], kind);
    }
    put(to, "]");
}

static void put_room(buffer *to, const room *r) {
    put(to, ", \"room\": ");
    if (!r->given) {
        put(to, "null");
        return;
    }
    put_scene_vec(to, "{\"low\": ", r->low);
    put_scene_vec(to, ", \"high\": ", r->high);
    for (int i = 0; i < 6; i++) put_scene_vec(to, i ? ", " : ", \"reflectances\": [", r->reflectances[i]);
    put_scene_vec(to, "], \"emission\": ", r->emission);
    for (size_t i = 0; i < r->material_count; i++) {
        put(to, i ? ", " : ", \"materials\": [");
        put_material(to, "", r->materials[i]);
    }
    put(to, r->material_count ? "]}" : "}");
}

/* SCN-8 */
static const char *scene_digest(const scene *s) {
    buffer to = {0};
    put(&to, "{\"name\": ");
    put_json_text(&to, s->name->text, s->name->length);
    put_scene_vec(&to, ", \"camera\": {\"position\": ", s->eye.position);
    put_scene_vec(&to, ", \"look_at\": ", s->eye.look_at);
    put_scene_vec(&to, ", \"up\": ", s->eye.up);
    put(&to, ", \"vertical_fov_deg\": ");
    put_shortest(&to, s->eye.fov);
    put(&to, "}");
    put_room(&to, &s->walls);
    put_parts(&to, ", \"boxes\": [", s->boxes, BOX);
    put_parts(&to, ", \"spheres\": [", s->spheres, SPHERE);
    put_parts(&to, ", \"quads\": [", s->quads, QUAD);
    put_parts(&to, ", \"lights\": [", s->lights, LIGHT);
    put_scene_vec(&to, ", \"background\": ", s->background);
    if (s->above.given) {
        put_scene_vec(&to, ", \"environment\": {\"zenith\": ", s->above.zenith);
        put_scene_vec(&to, ", \"horizon\": ", s->above.horizon);
        put_scene_vec(&to, ", \"ground\": ", s->above.ground);
        put_scene_vec(&to, ", \"sun_direction\": ", s->above.sun_direction);
        put_scene_vec(&to, ", \"sun_irradiance\": ", s->above.sun_irradiance);
        put(&to, ", \"sun_concentration\": ");
        put_shortest(&to, s->above.concentration);
        put(&to, "}");
    }
    put(&to, "}");
    return sha256((const unsigned char *)to.text, to.length);
}

/* ---- intersection: ISC ---------------------------------------------------------------------------------- */

#define MISS 1e30 /* ISC-2, LTR-1, MAT-2: the distance to nothing, and the density of what is no sample */

/* What is known of a surface by its number. */
typedef struct {
    v3 reflectance, emission, center;
    material made_of;
    int light; /* number of the light, or -1 */
} surface;

typedef struct {
    v3 corner, dual_u, dual_v, normal;
} plane;

typedef struct {
    v3 sun;      /* unit */
    double share; /* of the sun among samples */
} sky_samples;

typedef struct {
    int max_depth, roulette_depth; /* the latter -1 for none */
    enum { MIS, BY_LIGHT, BY_BSDF } strategy;
    int exponent;
    words (*draw)(uint32_t, uint32_t, uint32_t, uint32_t);
} settings;

/* A scene made ready. */
typedef struct {
    scene from;
    settings how;
    size_t first_box, first_sphere, first_quad, nothing;
    const part **boxes; /* in the order of their numbers */
    v3 *turned;         /* their centres in their own axes */
    plane *planes;      /* of quads, then lights */
    surface *surfaces;
    double *light_sums; /* running sums of the probabilities of lights; none where no light has power */
    sky_samples sun;
    bool samples_lights;
} world;

typedef struct {
    double t;
    size_t id;
    v3 point, normal;
} hit;

/* ISC-5 */
static double guarded(double x) { return fabs(x) >= 1e-15 ? x : x < 0 ? -1e-15 : 1e-15; }

/* ISC-3: where a ray enters and leaves each slab. */
static void slabs(v3 center, v3 half, v3 o, v3 d, v3 *enter, v3 *leave) {
    for (int k = 0; k < 3; k++) {
        double i = 1 / guarded(d.c[k]);
        double middle = (center.c[k] - o.c[k]) * i, reach = half.c[k] * fabs(i);
        enter->c[k] = middle - reach;
        leave->c[k] = middle + reach;
    }
}

/* ISC-4, ISC-8: the slabs that a ray enters last and leaves first; of equal ones the first axis. */
static bool meet_slabs(v3 center, v3 half, v3 o, v3 d, double *near, double *far, int *in, int *out) {
    v3 enter, leave;
    slabs(center, half, o, d, &enter, &leave);
    *near = -DBL_MAX;
    *far = DBL_MAX;
    for (int k = 0; k < 3; k++) {
        if (enter.c[k] > *near) {
            *near = enter.c[k];
            *in = k;
        }
        if (leave.c[k] < *far) {
            *far = leave.c[k];
            *out = k;
        }
    }
    return *near <= *far && *far > 0; /* ISC-4 */
}

/* ISC-6 */
static double sphere_distance(v3 center, double radius, v3 o, v3 d) {
    v3 f = sub(o, center);
    double b = -dot(f, d);
    v3 rest = add(f, scale(d, b));
    double discriminant = radius * radius - dot(rest, rest);
    if (!(discriminant > 0)) return MISS;
    double q = b >= 0 ? b + sqrt(discriminant) : b - sqrt(discriminant);
    double other = (dot(f, f) - radius * radius) / q, near = fmin(q, other), far = fmax(q, other);
    return near > 0 ? near : far > 0 ? far : MISS;
}

static plane plane_of(const part *p) {
    v3 n = cross(p->edge_u, p->edge_v);
    double square = dot(n, n);
    return (plane){p->corner, scale(cross(p->edge_v, n), 1 / square), scale(cross(n, p->edge_u), 1 / square),
                   unit(n)};
}

/* ISC-7 */
static double quad_distance(const plane *q, v3 o, v3 d) {
    double t = dot(sub(q->corner, o), q->normal) / guarded(dot(d, q->normal));
    v3 at = sub(add(o, scale(d, t)), q->corner);
    double a = dot(at, q->dual_u), b = dot(at, q->dual_v);
    return t > 0 && a >= 0 && a <= 1 && b >= 0 && b <= 1 ? t : MISS;
}

static v3 turned(const v3 rotation[3], v3 a) {
    return vec(dot(rotation[0], a), dot(rotation[1], a), dot(rotation[2], a)); /* VEC-4 */
}

static v3 facing(v3 normal, v3 d) { return dot(normal, d) > 0 ? scale(normal, -1) : normal; } /* ISC-8 */

static double sign_of(double x) { return guarded(x) < 0 ? -1 : 1; }

/* ISC-1, SCN-2: the least distance, and of equal ones the surface of the lowest number. */
static hit closest(const world *w, v3 o, v3 d) {
    hit best = {.t = MISS, .id = w->nothing, .point = BLACK, .normal = BLACK};
    double near, far;
    int in = 0, out = 0;
    const room *r = &w->from.walls;
    if (r->given) {
        v3 center = scale(add(r->low, r->high), 0.5), half = scale(sub(r->high, r->low), 0.5);
        if (meet_slabs(center, half, o, d, &near, &far, &in, &out) && far < best.t) {
            best.t = far;
            best.id = 2 * (size_t)out + (sign_of(d.c[out]) > 0);
            best.normal = BLACK;
            best.normal.c[out] = -sign_of(d.c[out]);
        }
    }
    for (size_t i = 0; i < w->from.boxes.count; i++) {
        const part *b = w->boxes[i];
        v3 own = turned(b->rotation, d);
        if (!meet_slabs(w->turned[i], b->half, turned(b->rotation, o), own, &near, &far, &in, &out)) continue;
        int axis = near > 0 ? in : out;
        double t = near > 0 ? near : far;
        if (t >= best.t) continue;
        best.t = t;
        best.id = w->first_box + i;
        best.normal = scale(b->rotation[axis], -sign_of(own.c[axis]));
    }
    for (size_t i = 0; i < w->from.spheres.count; i++) {
        const part *s = &w->from.spheres.items[i];
        double t = sphere_distance(s->center, s->radius, o, d);
        if (t >= best.t) continue;
        best.t = t;
        best.id = w->first_sphere + i;
        best.normal = facing(scale(sub(add(o, scale(d, t)), s->center), 1 / s->radius), d);
    }
    for (size_t i = 0; w->first_quad + i < w->nothing; i++) {
        double t = quad_distance(&w->planes[i], o, d);
        if (t >= best.t) continue;
        best.t = t;
        best.id = w->first_quad + i;
        best.normal = facing(w->planes[i].normal, d);
    }
    if (best.id < w->nothing) best.point = add(o, scale(d, best.t)); /* ISC-2: else 0 */
    return best;
}

/* ISC-9 */
static v3 spawned(v3 p, v3 n, double t) {
    double size = fmax(fabs(p.c[0]), fmax(fabs(p.c[1]), fabs(p.c[2])));
    return add(p, scale(n, 64 / 16777216.0 * (size + t)));
}

/* ISC-10 */
static bool occluded(const world *w, v3 o, v3 d, double distance) { return closest(w, o, d).t < distance; }

/* ISC-12 */
static v3 turned_center(const part *b) {
    v3 made = turned(b->rotation, b->center);
    for (int i = 0; i < 3; i++) {
        double size = 0;
        for (int k = 0; k < 3; k++) size += fabs(b->rotation[i].c[k] * b->center.c[k]);
        if (fabs(made.c[i]) <= 16 / 9007199254740992.0 * size) made.c[i] = 0;
    }
    return made;
}

static bool same_rotation(const part *a, const part *b) {
    for (int i = 0; i < 9; i++)
        if (a->rotation[i / 3].c[i % 3] != b->rotation[i / 3].c[i % 3]) return false;
    return true;
}

/* ISC-1: boxes of one rotation stand together, in the order in which rotations appear. */
static void number_boxes(world *w) {
    parts list = w->from.boxes;
    bool *taken = get(list.count, sizeof *taken);
    size_t found = 0;
    w->boxes = get(list.count, sizeof *w->boxes);
    w->turned = get(list.count, sizeof *w->turned);
    for (size_t i = 0; i < list.count; i++)
        for (size_t k = i; k < list.count && !taken[i]; k++)
            if (k > i && !taken[k] && same_rotation(&list.items[i], &list.items[k])) {
                w->boxes[found++] = &list.items[k];
                taken[k] = true;
            } else if (k == i) {
                w->boxes[found++] = &list.items[i];
            }
    for (size_t i = 0; i < list.count; i++) w->turned[i] = turned_center(w->boxes[i]);
}

static double area(const part *p) { return length(cross(p->edge_u, p->edge_v)); }

/* SCN-5 */
static v3 light_radiance(const part *l) { return scale(l->color, l->power / (PI * area(l))); }

/* LTR-3: lights are picked in proportion to power times the sum of the colour. */
static void weigh_lights(world *w) {
    parts list = w->from.lights;
    double total = 0, running = 0;
    for (size_t i = 0; i < list.count; i++) total += list.items[i].power * sum(list.items[i].color);
    if (!(total > 0)) return;
    w->light_sums = get(list.count, sizeof *w->light_sums);
    for (size_t i = 0; i < list.count; i++) {
        running += list.items[i].power * sum(list.items[i].color);
        w->light_sums[i] = running / total;
    }
}

/* ENV-2 */
static sky_samples weigh_sun(const sky *s) {
    double sun = sum(s->sun_irradiance), all = PI * (sum(s->zenith) + 2 * sum(s->horizon) + sum(s->ground));
    return (sky_samples){unit(s->sun_direction), sun + all > 0 ? sun / (sun + all) : 0};
}

static bool is_single(material m) { return m.given && (m.kind == MIRROR || m.kind == DIELECTRIC); }

static world build(scene from, settings how) {
    world w = {.from = from, .how = how};
    parts quads = from.quads, lights = from.lights;
    w.first_box = from.walls.given ? 6 : 0;
    w.first_sphere = w.first_box + from.boxes.count;
    w.first_quad = w.first_sphere + from.spheres.count;
    w.nothing = w.first_quad + quads.count + lights.count;
    number_boxes(&w);
    w.planes = get(quads.count + lights.count, sizeof *w.planes);
    w.surfaces = get(w.nothing + 1, sizeof *w.surfaces);
    surface *s = w.surfaces;
    for (size_t i = 0; i < w.first_box; i++)
        *s++ = (surface){from.walls.reflectances[i], from.walls.emission, BLACK, from.walls.materials[i], -1};
    for (size_t i = 0; i < from.boxes.count; i++) {
        const part *p = w.boxes[i];
        *s++ = (surface){p->reflectance, p->emission, p->center, p->made_of, -1};
    }
    for (size_t i = 0; i < from.spheres.count; i++) {
        const part *p = &from.spheres.items[i];
        *s++ = (surface){p->reflectance, p->emission, p->center, p->made_of, -1};
    }
    for (size_t i = 0; i < quads.count; i++) {
        const part *p = &quads.items[i];
        w.planes[i] = plane_of(p);
        *s++ = (surface){p->reflectance, p->emission, BLACK, p->made_of, -1};
    }
    for (size_t i = 0; i < lights.count; i++) {
        w.planes[quads.count + i] = plane_of(&lights.items[i]);
        *s++ = (surface){BLACK, light_radiance(&lights.items[i]), BLACK, {0}, (int)i};
    }
    *s = (surface){BLACK, from.background, BLACK, {0}, -1};
    weigh_lights(&w);
    if (from.above.given) w.sun = weigh_sun(&from.above);
    bool single = w.first_quad + quads.count > 0; /* SHD-4; lights and nothing have no material of their own */
    for (size_t i = 0; i < w.first_quad + quads.count; i++) single = single && is_single(w.surfaces[i].made_of);
    w.samples_lights = (w.light_sums || from.above.given) && how.strategy != BY_BSDF && !single;
    return w;
}

/* ---- materials: MAT, LAM, MIR, CDR, DIE ----------------------------------------------------------------- */

/* SHD-3: a vertex, without its beta. */
typedef struct {
    v3 wo, normal, reflectance;
    bool outside;
    material made_of;
} site;

/* MAT-1: where a path goes on, what its beta is multiplied by, the density, and whether it passes through. */
typedef struct {
    v3 direction, factor;
    double pdf;
    bool through;
} scattered;

/* MAT-3 */
static v3 mirrored(v3 wo, v3 n) { return unit(sub(scale(n, 2 * clamp(dot(n, wo), 0, 1)), wo)); }

/* CDR-4 */
static v3 schlick(v3 r, double cosine) {
    double rest = pow(1 - clamp(cosine, 0, 1), 5);
    return add(r, scale(sub(vec(1, 1, 1), r), rest));
}

/* CDR-1 */
static double ggx(v3 m, double alpha) {
    double s = m.c[0] * m.c[0] + m.c[1] * m.c[1] + alpha * alpha * m.c[2] * m.c[2];
    return alpha * alpha / (PI * s * s);
}

static double stretched_length(v3 w, double alpha) { /* q(w) of the chapter, below the surface as at it */
    double z = fmax(w.c[2], 0);
    return sqrt(z * z + alpha * alpha * (w.c[0] * w.c[0] + w.c[1] * w.c[1]));
}

/* CDR-3, by Heitz 2018 */
static v3 visible_normal(double u0, double u1, v3 wo, double alpha) {
    v3 axis = unit(vec(alpha * wo.c[0], alpha * wo.c[1], wo.c[2]));
    double square = axis.c[0] * axis.c[0] + axis.c[1] * axis.c[1], x, y;
    v3 t = square > 1e-30 ? scale(vec(-axis.c[1], axis.c[0], 0), 1 / sqrt(square)) : vec(1, 0, 0);
    concentric_disk(u0, u1, &x, &y);
    double share = 0.5 * (1 + axis.c[2]);
    y = (1 - share) * sqrt(fmax(0, 1 - x * x)) + share * y;
    v3 n = add(add(scale(t, x), scale(cross(axis, t), y)), scale(axis, sqrt(fmax(0, 1 - x * x - y * y))));
    return unit(vec(alpha * n.c[0], alpha * n.c[1], fmax(n.c[2], 0)));
}

/* CDR-2, CDR-3: wo is 1e-7 above the surface at least. */
static v3 above(v3 local) { return vec(local.c[0], local.c[1], fmax(local.c[2], 1e-7)); }

/* CDR-3 */
static scattered sample_conductor(const site *s, double u0, double u1) {
    double alpha = s->made_of.value;
    v3 wo = above(to_local(s->wo, s->normal)), m = visible_normal(u0, u1, wo, alpha), wi = mirrored(wo, m);
    double zo = wo.c[2], zi = wi.c[2], qo = stretched_length(wo, alpha), qi = stretched_length(wi, alpha);
    double masking = zi > 0 ? zi * (qo + zo) / (qo * zi + qi * zo) : 0;
    return (scattered){to_world(wi, s->normal), scale(schlick(s->reflectance, dot(wo, m)), masking),
                       ggx(m, alpha) / (2 * (qo + zo)), false};
}

/* DIE-3 */
static double fresnel(double r, double c, double behind) {
    double across = (c - r * behind) / fmax(c + r * behind, 1e-30);
    double along = (r * c - behind) / fmax(r * c + behind, 1e-30);
    return behind == 0 && r > 1 ? 1 : 0.5 * (across * across + along * along);
}

/* DIE-2 */
static v3 refracted(v3 wo, v3 normal, double r, double c, double *behind) {
    *behind = sqrt(fmax(0, (1 - r) * (1 + r) + r * c * (r * c)));
    return unit(sub(scale(normal, r * c - *behind), scale(wo, r)));
}

/* DIE-4 */
static scattered sample_dielectric(const site *s, double u_choice) {
    double r = s->outside ? 1 / s->made_of.value : s->made_of.value, c = clamp(dot(s->normal, s->wo), 0, 1);
    double behind;
    v3 through = refracted(s->wo, s->normal, r, c, &behind);
    if (u_choice < fresnel(r, c, behind))
        return (scattered){mirrored(s->wo, s->normal), s->reflectance, MISS, false};
    return (scattered){through, s->reflectance, MISS, true};
}

/* LAM-1, MIR-1 and the two above */
static scattered sample_material(const site *s, double u0, double u1, double u_choice) {
    if (s->made_of.kind == MIRROR) return (scattered){mirrored(s->wo, s->normal), s->reflectance, MISS, false};
    if (s->made_of.kind == CONDUCTOR) return sample_conductor(s, u0, u1);
    if (s->made_of.kind == DIELECTRIC) return sample_dielectric(s, u_choice);
    v3 local = cosine_hemisphere(u0, u1);
    return (scattered){to_world(local, s->normal), s->reflectance, local.c[2] / PI, false};
}

/* LAM-1, CDR-2, MAT-2: f cos of light from wi, and the density of wi. */
static v3 material_value(const site *s, v3 wi, double *pdf) {
    double alpha = s->made_of.value, cosine = fmax(0, dot(s->normal, wi));
    *pdf = 0;
    if (is_single(s->made_of) || cosine <= 0) return BLACK;
    if (s->made_of.kind == LAMBERTIAN) {
        *pdf = cosine / PI;
        return scale(s->reflectance, cosine / PI);
    }
    v3 o = above(to_local(s->wo, s->normal)), i = to_local(wi, s->normal), m = unit(add(o, i));
    double zo = o.c[2], zi = i.c[2], qo = stretched_length(o, alpha), qi = stretched_length(i, alpha);
    *pdf = ggx(m, alpha) / (2 * (qo + zo));
    return scale(schlick(s->reflectance, dot(o, m)), ggx(m, alpha) * zi / (2 * (qo * zi + qi * zo)));
}

/* ---- the sky: ENV --------------------------------------------------------------------------------------- */

static double versine(const world *w, v3 d) {
    v3 chord = sub(d, w->sun.sun); /* 1 - cos without cancellation */
    return 0.5 * dot(chord, chord);
}

/* ENV-1: without the sun. */
static v3 sky_gradient(const sky *s, v3 d) {
    v3 end = d.c[1] > 0 ? s->zenith : s->ground;
    return add(s->horizon, scale(sub(end, s->horizon), fabs(d.c[1])));
}

/* ENV-7: over all directions. */
static v3 sky_mean(const sky *s) {
    return scale(add(add(s->zenith, s->ground), scale(s->horizon, 2)), 0.25);
}

/* ENV-1 */
static v3 sky_radiance(const world *w, v3 d) {
    const sky *s = &w->from.above;
    v3 glow = scale(s->sun_irradiance, spherical_cauchy_pdf(versine(w, d), s->concentration));
    return add(sky_gradient(s, d), glow);
}

/* ENV-2 */
static v3 sky_sample(const world *w, double u_choice, double u0, double u1) {
    double k = u_choice < w->sun.share ? w->from.above.concentration : 0;
    return to_world(spherical_cauchy(u0, u1, k), w->sun.sun);
}

/* ENV-3 */
static double sky_pdf(const world *w, v3 d) {
    double lobe = spherical_cauchy_pdf(versine(w, d), w->from.above.concentration);
    return w->sun.share * lobe + (1 - w->sun.share) / (4 * PI);
}

/* ---- light transport: CAM, LTR, RND --------------------------------------------------------------------- */

/* LTR-1 */
typedef struct {
    v3 origin, direction, beta, radiance;
    double pdf;
} path;

/* CAM-1: forward, right and up. */
static double axes(const camera *c, v3 axis[3]) {
    axis[0] = unit(sub(c->look_at, c->position));
    axis[1] = unit(cross(axis[0], c->up));
    axis[2] = cross(axis[1], axis[0]);
    return tan(c->fov * PI / 360);
}

/* CAM-2, CAM-3 */
static v3 camera_direction(const camera *c, double width, double height, double x, double y) {
    v3 axis[3];
    double reach = axes(c, axis) / height;
    v3 aside = scale(axis[1], (2 * x - width) * reach), up = scale(axis[2], (height - 2 * y) * reach);
    return unit(add(add(axis[0], aside), up));
}

/* RNG-4 */
static uint32_t pixel_counter(uint32_t x, uint32_t y) { return x + 65536u * y; }

/* RNG-7, CAM-4, RND-5 */
static path start(const world *w, uint32_t width, uint32_t height, uint32_t x, uint32_t y, uint32_t seed,
                  uint32_t sample) {
    words u = w->how.draw(seed, pixel_counter(x, y), sample, 0);
    v3 d = camera_direction(&w->from.eye, width, height, x + uniform(u.w[0]), y + uniform(u.w[1]));
    return (path){w->from.eye.position, d, vec(1, 1, 1), BLACK, MISS};
}

/* LTR-5 */
static double mis_weight(double pdf, double other, int exponent) {
    return 1 / (1 + pow(other / fmax(pdf, 1e-15), exponent));
}

/* ENV-4: the share of light samples that go to the sky. */
static double sky_share(const world *w) { return !w->from.above.given ? 0 : w->light_sums ? 0.5 : 1; }

/* LTR-3 */
static double light_pdf(const world *w, size_t light, double square, double cosine) {
    double p = discrete_probability(light, w->light_sums) * (1 - sky_share(w));
    return p * square / (area(&w->from.lights.items[light]) * fmax(cosine, 1e-15));
}

/* LTR-2, LTR-6, ENV-5 */
static double emission_weight(const world *w, const path *p, const hit *h) {
    int light = w->surfaces[h->id].light;
    bool to_sky = w->from.above.given && h->id == w->nothing;
    if (!w->samples_lights || !((light >= 0 && w->light_sums) || to_sky)) return 1;
    if (w->how.strategy == BY_LIGHT) return p->pdf < MISS ? 0 : 1;
    double cosine = fabs(dot(h->normal, p->direction));
    double other = to_sky ? sky_pdf(w, p->direction) * sky_share(w)
                          : light_pdf(w, (size_t)light, h->t * h->t, cosine);
    return mis_weight(p->pdf, other, w->how.exponent);
}

/* SCN-5: what a surface emits towards the origin of a ray; a light from its front alone. */
static v3 emission_towards(const world *w, const hit *h, v3 d) {
    const surface *s = &w->surfaces[h->id];
    if (h->id == w->nothing && w->from.above.given) return sky_radiance(w, d);
    if (s->light < 0) return s->emission;
    return dot(w->planes[h->id - w->first_quad].normal, d) < 0 ? s->emission : BLACK;
}

/* LTR-11 */
static v3 unshadowed(parts lights, v3 point, v3 normal, v3 reflectance) {
    v3 found = BLACK;
    for (size_t i = 0; i < lights.count; i++) {
        const part *l = &lights.items[i];
        v3 middle = add(l->corner, scale(add(l->edge_u, l->edge_v), 0.5)), offset = sub(middle, point);
        double square = dot(offset, offset), distance = sqrt(square);
        double here = fmax(0, dot(normal, offset) / distance);
        double there = fmax(0, -dot(unit(cross(l->edge_u, l->edge_v)), offset) / distance);
        found = add(found, scale(light_radiance(l), area(l) * here * there / (square + area(l) / PI)));
    }
    return scale(mul(reflectance, found), 1 / PI);
}

static double components(v3 v) { return v.c[0] + v.c[1] + v.c[2]; }

/* LTR-12: lamp k's light, without its hue. */
static double lamp_light(const part *l, v3 point, v3 normal) {
    return components(unshadowed((parts){(part *)l, 1}, point, normal, vec(PI, PI, PI)));
}

/* LTR-12: the way to a point of a lamp, and its light. */
typedef struct {
    v3 wi, radiance;
    double distance, power;
} to_light;

static to_light to_lamp(const part *lamp, v3 origin, double u0, double u1) {
    v3 front = unit(cross(lamp->edge_u, lamp->edge_v));
    v3 point = quad_point(u0, u1, lamp->corner, lamp->edge_u, lamp->edge_v);
    double size = fmax(fabs(origin.c[0]), fmax(fabs(origin.c[1]), fabs(origin.c[2])));
    v3 offset = sub(spawned(point, front, size), origin), wi = scale(offset, 1 / length(offset));
    v3 radiance = dot(front, wi) < 0 ? light_radiance(lamp) : BLACK;
    return (to_light){wi, radiance, length(offset), components(light_radiance(lamp))};
}

/* ENV-7 */
static to_light to_sky(const world *w, v3 normal, double wanted, double sun, double rest, double u1) {
    const sky *s = &w->from.above;
    if (wanted < sun) {
        v3 wi = to_world(spherical_cauchy(fmin(wanted / fmax(sun, 1e-15), 1), u1, s->concentration), w->sun.sun);
        return (to_light){wi, s->sun_irradiance, MISS, components(s->sun_irradiance)};
    }
    v3 wi = to_world(cosine_hemisphere(fmin((wanted - sun) / fmax(rest, 1e-15), 1), u1), normal);
    return (to_light){wi, sky_gradient(s, wi), MISS, components(sky_mean(s))};
}

/* LTR-12 */
static v3 direct(const world *w, const hit *h, v3 reflectance, uint32_t seed, uint32_t pixel, uint32_t sample,
                 uint32_t rays, uint32_t number) {
    parts lamps = w->from.lights;
    const sky *above = &w->from.above;
    double light = 0, before = 0, u = 0, sun = 0, rest = 0;
    if (h->id >= w->nothing || w->surfaces[h->id].light >= 0) return BLACK;
    for (size_t k = 0; k < lamps.count; k++) light += lamp_light(&lamps.items[k], h->point, h->normal);
    if (above->given) {
        sun = components(above->sun_irradiance) * fmax(0, dot(h->normal, w->sun.sun));
        rest = PI * components(sky_mean(above));
    }
    words at = net_words(seed, pixel, sample * rays + number, 0xFFFFFFFFu);
    double wanted = uniform(at.w[0]) * (light + sun + rest), u1 = uniform(at.w[1]);
    const part *chosen = NULL;
    for (size_t k = 0; k < lamps.count && before <= wanted; k++) {
        double own = lamp_light(&lamps.items[k], h->point, h->normal);
        chosen = &lamps.items[k];
        u = fmin((wanted - before) / fmax(own, 1e-15), 1);
        before += own;
    }
    bool to_above = above->given && wanted >= light;
    if (!(light + sun + rest > 0) || (!chosen && !to_above)) return BLACK;
    v3 origin = spawned(h->point, h->normal, h->t);
    to_light to = to_above ? to_sky(w, h->normal, wanted - light, sun, rest, u1) : to_lamp(chosen, origin, u, u1);
    if (!(dot(h->normal, to.wi) > 0) || occluded(w, origin, to.wi, to.distance)) return BLACK;
    return scale(mul(reflectance, to.radiance), (light + sun + rest) / (fmax(to.power, 1e-15) * PI * rays));
}

/* LTR-2 */
static hit arrive(const world *w, path *p) {
    hit h = closest(w, p->origin, p->direction);
    v3 light = scale(emission_towards(w, &h, p->direction), emission_weight(w, p, &h));
    p->radiance = add(p->radiance, mul(p->beta, light));
    return h;
}

/* LTR-3, LTR-4, ENV-4: what a light sample adds, for a beta of 1. */
static v3 direct_light(const world *w, const site *s, v3 origin, double u_pick, double u0, double u1) {
    double share = sky_share(w), cos_light = 1, distance = MISS, pdf, other;
    v3 wi, light;
    if (u_pick < share) {
        wi = sky_sample(w, u_pick / share, u0, u1);
        light = sky_radiance(w, wi);
        pdf = sky_pdf(w, wi) * share;
    } else {
        size_t k = discrete((u_pick - share) / (1 - share), w->light_sums, w->from.lights.count);
        const part *l = &w->from.lights.items[k];
        v3 normal = unit(cross(l->edge_u, l->edge_v));
        v3 point = quad_point(u0, u1, l->corner, l->edge_u, l->edge_v);
        double size = fmax(fabs(origin.c[0]), fmax(fabs(origin.c[1]), fabs(origin.c[2])));
        v3 offset = sub(spawned(point, normal, size), origin);
        distance = length(offset);
        wi = scale(offset, 1 / distance);
        cos_light = -dot(normal, wi);
        light = light_radiance(l);
        pdf = light_pdf(w, k, distance * distance, cos_light);
    }
    if (!(dot(s->normal, wi) > 0 && cos_light > 0) || occluded(w, origin, wi, distance)) return BLACK;
    v3 value = material_value(s, wi, &other);
    double weight = w->how.strategy == MIS ? mis_weight(pdf, other, w->how.exponent) : 1;
    return mul(value, scale(light, weight / pdf));
}

/* LTR-7, LTR-8, LTR-9, RNG-7: leave a surface; returns whether the path goes on. */
static bool scatter(const world *w, path *p, const hit *h, v3 reflectance, uint32_t depth, uint32_t seed,
                    uint32_t pixel, uint32_t sample) {
    if (h->id >= w->nothing) return false;
    words u = w->how.draw(seed, pixel, sample, 1 + 2 * depth);
    words v = w->how.draw(seed, pixel, sample, 2 + 2 * depth);
    const surface *at = &w->surfaces[h->id];
    site s = {scale(p->direction, -1), h->normal, reflectance, dot(h->normal, sub(h->point, at->center)) > 0,
              at->made_of}; /* DIE-1 */
    v3 origin = spawned(h->point, h->normal, h->t);
    if (w->samples_lights) {
        v3 light = direct_light(w, &s, origin, uniform(u.w[0]), uniform(u.w[1]), uniform(u.w[2]));
        p->radiance = add(p->radiance, mul(p->beta, light));
    }
    scattered on = sample_material(&s, uniform(v.w[0]), uniform(v.w[1]), uniform(v.w[2]));
    p->origin = on.through ? spawned(h->point, scale(h->normal, -1), h->t) : origin;
    p->direction = on.direction;
    p->beta = mul(p->beta, on.factor);
    p->pdf = on.pdf;
    if (!(largest(p->beta) > 0)) return false;
    if (w->how.roulette_depth >= 0 && depth >= (uint32_t)w->how.roulette_depth) {
        double q = fmin(largest(p->beta), 0.95);
        p->beta = scale(p->beta, 1 / q);
        return uniform(u.w[3]) < q;
    }
    return true;
}

/* ---- images: ENC, DAT, RNG ------------------------------------------------------------------------------ */

/* ENC-1 */
static double srgb_encode(double x) { return x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1 / 2.4) - 0.055; }

/* ENC-4 */
static double exposed(double linear, double stops) { return linear * exp2(stops); }

/* ENC-5 */
static double to_display(double linear, double stops) { return srgb_encode(clamp(exposed(linear, stops), 0, 1)); }

static const char *const FEATURES[] = {"color",       "albedo",        "normal",     "depth",
                                       "position",    "direction",     "unshadowed", "highlights",
                                       "seen_albedo", "seen_normal",   "seen_depth", "seen_position",
                                       "seen_emission", "history", "history_weight", "smoothed", "seen_smoothed",
                                       "sun", "direct"};

typedef enum {
    COLOR,
    ALBEDO,
    NORMAL,
    DEPTH,
    POSITION,
    DIRECTION,
    UNSHADOWED,
    HIGHLIGHTS,
    SEEN_ALBEDO,
    SEEN_NORMAL,
    SEEN_DEPTH,
    SEEN_POSITION,
    SEEN_EMISSION,
    HISTORY,
    HISTORY_WEIGHT,
    SMOOTHED,
    SEEN_SMOOTHED,
    SUN,
    DIRECT,
    FEATURE_COUNT
} feature;

typedef struct {
    feature items[FEATURE_COUNT];
    size_t count, channels;
} features;

static size_t channels_of(feature f) { return f == DEPTH || f == SEEN_DEPTH || f == HISTORY_WEIGHT ? 1 : 3; }

/* DAT-9 */
static void add_feature(features *to, const char *name, size_t length) {
    int f = 0;
    while (f < FEATURE_COUNT && (strlen(FEATURES[f]) != length || memcmp(FEATURES[f], name, length))) f++;
    if (f == FEATURE_COUNT) refuse("%.*s is no feature", length < 80 ? (int)length : 80, name);
    for (size_t i = 0; i < to->count; i++)
        if (to->items[i] == (feature)f) refuse("the feature %s stands there twice", FEATURES[f]);
    to->items[to->count++] = (feature)f;
    to->channels += channels_of((feature)f);
}

static features features_named(const char *names) {
    features made = {.count = 0};
    for (;;) {
        size_t length = strcspn(names, ",");
        add_feature(&made, names, length);
        if (!names[length]) return made;
        names += length + 1;
    }
}

/* DAT-2 */
typedef struct {
    double stops, depth_scale, position_scale;
    v3 position_center;
} scales;

static scales read_scales(const json *in) {
    scales made = {number(in, "exposure_stops"), number(in, "depth_scale"), number(in, "position_scale"),
                   vec_in(in, "position_center")};
    if (!(fabs(made.stops) <= 64) || !(made.depth_scale >= 1e-18 && made.depth_scale <= 1e18)
        || !(made.position_scale >= 1e-18 && made.position_scale <= 1e18))
        refuse("stops must be within -64 and 64, lengths within 1e-18 and 1e18");
    check_range(made.position_center, -1e18, 1e18, "position_center");
    return made;
}

/* DAT-1, SMO-1: the layer that a feature is made of */
static const char *layer_of(feature f) {
    return FEATURES[f == HIGHLIGHTS || f == SMOOTHED || f == SEEN_SMOOTHED ? COLOR : f];
}

/* DAT-1, DAT-10 */
static double encoded(feature f, double x, size_t channel, const scales *s) {
    if (isnan(x)) x = 0;
    if (f == COLOR || f == UNSHADOWED || f == SEEN_EMISSION || f == HISTORY || f == DIRECT || f == SMOOTHED ||
        f == SEEN_SMOOTHED)
        return to_display(x, s->stops);
    if (f == HIGHLIGHTS) return to_display(x, s->stops - 4);
    if (f == ALBEDO || f == SEEN_ALBEDO || f == HISTORY_WEIGHT) return clamp(x, 0, 1);
    if (f == DEPTH || f == SEEN_DEPTH) return clamp(x / s->depth_scale, 0, 1);
    if (f == POSITION || f == SEEN_POSITION) x = (x - s->position_center.c[channel]) / s->position_scale;
    return clamp(x, -1, 1);
}

/* SMO-3: what pixels are compared by, and the depth that their positions are a share of */
enum { NORMAL_GUIDE, ALBEDO_GUIDE, POSITION_GUIDE, DEPTH_GUIDE, GUIDE_COUNT };

static const char *const GUIDES[2][GUIDE_COUNT]
    = {{"normal", "albedo", "position", "depth"}, {"seen_normal", "seen_albedo", "seen_position", "seen_depth"}};

static void check_layer(const array *layer, const array *like, size_t channels, const char *name) {
    if (layer->shape[2] != channels || layer->shape[0] != like->shape[0] || layer->shape[1] != like->shape[1]
        || !layer->count)
        refuse("the layer %s has another shape", name);
}

/* DAT-10 */
static void forget_nan(array *layer) {
    for (size_t k = 0; k < layer->count; k++)
        if (isnan(layer->values[k])) layer->values[k] = 0;
}

static void read_guides(const json *in, const char *const *names, const array *color, array *guides) {
    for (int g = 0; g < GUIDE_COUNT; g++) {
        guides[g] = array_in(in, names[g], 3);
        check_layer(&guides[g], color, g == DEPTH_GUIDE ? 1 : 3, names[g]);
        forget_nan(&guides[g]);
        for (size_t k = 0; k < guides[g].count; k++)
            guides[g].values[k] = clamp(guides[g].values[k], g == DEPTH_GUIDE ? 1e-6 : -1e9, 1e9);
    }
}

/* SMO-3: the weight of pixel q for pixel p, without the spline's */
static double alike(const array *guides, size_t p, size_t q) {
    double sigmas[] = {0.5, 0.2, 0.08 * guides[DEPTH_GUIDE].values[p]}, sum = 0;
    for (int g = 0; g < DEPTH_GUIDE; g++)
        for (size_t c = 0; c < 3; c++) {
            double apart = (guides[g].values[3 * q + c] - guides[g].values[3 * p + c]) / sigmas[g];
            sum += apart * apart;
        }
    return exp(-0.5 * sum);
}

static size_t within(long at, size_t count) { return at < 0 ? 0 : at < (long)count ? (size_t)at : count - 1; }

/* SMO-3 */
static array smoothed(array color, const array *guides, unsigned levels) {
    static const double SPLINE[] = {1 / 16.0, 1 / 4.0, 3 / 8.0, 1 / 4.0, 1 / 16.0};
    size_t height = color.shape[0], width = color.shape[1];
    for (unsigned level = 0; level < levels; level++) {
        array made = new_array(3, color.shape);
        for (size_t p = 0; p < height * width; p++) {
            double weights = 0;
            for (long dy = -2; dy <= 2; dy++)
                for (long dx = -2; dx <= 2; dx++) {
                    size_t row = within((long)(p / width) + dy * (1L << level), height);
                    size_t q = row * width + within((long)(p % width) + dx * (1L << level), width);
                    double w = SPLINE[dy + 2] * SPLINE[dx + 2] * alike(guides, p, q);
                    weights += w;
                    for (size_t c = 0; c < 3; c++) made.values[3 * p + c] += w * color.values[3 * q + c];
                }
            for (size_t c = 0; c < 3; c++) made.values[3 * p + c] /= weights;
        }
        color = made;
    }
    return color;
}

/* SMO-1, SMO-2 */
static array smoothed_layer(const json *in, feature f, const scales *s) {
    array color = array_in(in, layer_of(f), 3), guides[GUIDE_COUNT];
    check_layer(&color, &color, 3, layer_of(f));
    forget_nan(&color);
    for (size_t k = 0; k < color.count; k++) color.values[k] = clamp(color.values[k], 0, 16 / exp2(s->stops));
    read_guides(in, GUIDES[f == SEEN_SMOOTHED], &color, guides);
    return smoothed(color, guides, 3);
}

/* DAT-3 */
static array feature_image(const json *in, const features *wanted, const scales *s) {
    array image = {0};
    size_t offset = 0;
    for (size_t i = 0; i < wanted->count; i++) {
        feature f = wanted->items[i];
        bool filtered = f == SMOOTHED || f == SEEN_SMOOTHED;
        array layer = filtered ? smoothed_layer(in, f, s) : array_in(in, layer_of(f), 3);
        size_t channels = channels_of(f);
        if (!i) {
            size_t shape[3] = {layer.shape[0], layer.shape[1], wanted->channels};
            image = new_array(3, shape);
        }
        check_layer(&layer, &image, channels, layer_of(f));
        for (size_t k = 0; k < layer.count; k++)
            image.values[k / channels * wanted->channels + offset + k % channels]
                = (float)encoded(f, layer.values[k], k % channels, s);
        offset += channels;
    }
    return image;
}

typedef struct {
    size_t size;
    bool zeros;
} window;

/* DAT-9 */
static window read_window(const json *in) {
    const json *size = field(in, "size");
    window made = {(size_t)whole_of(size, 1, 64, "the window's size"), !strcmp(text(in, "border"), "zero")};
    if (!made.zeros && strcmp(text(in, "border"), "clamp")) refuse("the border must be clamp or zero");
    return made;
}

/* DAT-4, DAT-5, DAT-6 */
static void window_at(const array *image, window w, size_t x, size_t y, double *taps) {
    long height = (long)image->shape[0], width = (long)image->shape[1], size = (long)w.size;
    size_t channels = image->shape[2];
    for (long dy = 0; dy < size; dy++)
        for (long dx = 0; dx < size; dx++) {
            long row = (long)y + dy - size / 2, column = (long)x + dx - size / 2;
            bool outside = row < 0 || row >= height || column < 0 || column >= width;
            row = row < 0 ? 0 : row >= height ? height - 1 : row;
            column = column < 0 ? 0 : column >= width ? width - 1 : column;
            for (size_t c = 0; c < channels; c++)
                *taps++ = outside && w.zeros ? 0 : image->values[(size_t)(row * width + column) * channels + c];
        }
}

/* DAT-8 */
static uint64_t pixel_draw(uint32_t seed, uint32_t stream, uint32_t i, uint64_t count) {
    uint32_t word = random_block(seed, i / 4, stream, 0x50495845).w[i % 4];
    return (uint64_t)word * count >> 32;
}

/* ---- network: SIR, ADM, TRN ----------------------------------------------------------------------------- */

enum { MOST_LAYERS = 64 };

typedef struct {
    size_t layers, widths[MOST_LAYERS + 1];
    double *weights[MOST_LAYERS], *biases[MOST_LAYERS];
    double omega_first, omega_hidden;
    bool rectifies;
} network;

static double omega(const network *n, size_t layer) { return layer ? n->omega_hidden : n->omega_first; }

/* SIR-2: the argument of the sine of a layer's neurons, or the output of the last. */
static void affine(const network *n, size_t layer, const double *x, double *z) {
    size_t in = n->widths[layer], out = n->widths[layer + 1];
    for (size_t i = 0; i < out; i++) {
        z[i] = n->biases[layer][i];
        for (size_t k = 0; k < in; k++) z[i] += n->weights[layer][i * in + k] * x[k];
        if (layer + 1 < n->layers) z[i] *= omega(n, layer);
    }
}

/* ACT-1 */
static double activated(const network *n, double a) {
    if (!n->rectifies) return sin(a);
    return a < 0 ? 0 : a;
}

static double *forward_layer(const network *n, size_t layer, const double *x) {
    double *z = get(n->widths[layer + 1], sizeof *z);
    affine(n, layer, x, z);
    for (size_t i = 0; i < n->widths[layer + 1] && layer + 1 < n->layers; i++) z[i] = activated(n, z[i]);
    return z;
}

/* SIR-7, TRN-3: add the derivatives of one row of a batch of `rows` to those that are there; return its loss. */
static double gradient(const network *n, const double *x, const double *target, size_t rows, network *sums) {
    double *inputs[MOST_LAYERS + 1], loss = 0;
    size_t last = n->layers - 1, out = n->widths[n->layers];
    inputs[0] = get(n->widths[0], sizeof(double));
    memcpy(inputs[0], x, n->widths[0] * sizeof(double));
    for (size_t l = 0; l < n->layers; l++) inputs[l + 1] = forward_layer(n, l, inputs[l]);
    double *dz = get(out, sizeof *dz), count = (double)(rows * out);
    for (size_t i = 0; i < out; i++) {
        double off = inputs[n->layers][i] - target[i];
        loss += off * off / count;
        dz[i] = 2 * off / count;
    }
    for (size_t l = last + 1; l-- > 0;) {
        size_t wide = n->widths[l], high = n->widths[l + 1];
        double *dx = get(wide, sizeof *dx), *a = get(wide, sizeof *a);
        for (size_t i = 0; i < high; i++) {
            sums->biases[l][i] += dz[i];
            for (size_t k = 0; k < wide; k++) {
                sums->weights[l][i * wide + k] += dz[i] * inputs[l][k];
                dx[k] += dz[i] * n->weights[l][i * wide + k];
            }
        }
        if (l) affine(n, l - 1, inputs[l - 1], a);
        for (size_t k = 0; k < wide && l; k++) dx[k] *= cos(a[k]) * omega(n, l - 1);
        dz = dx;
    }
    return loss;
}

/* SIR-3, SIR-4, SIR-5 */
static double initial(uint32_t seed, size_t layer, uint32_t tag, size_t i, double bound) {
    words u = random_block(seed, (uint32_t)(i / 4), (uint32_t)layer, tag);
    return (float)((2 * uniform(u.w[i % 4]) - 1) * bound);
}

static network new_network(size_t layers, const size_t *widths) {
    network made = {.layers = layers};
    if (!layers || layers > MOST_LAYERS) refuse("a network has 1 to %d layers", MOST_LAYERS);
    for (size_t l = 0; l <= layers; l++) made.widths[l] = widths[l];
    for (size_t l = 0; l < layers; l++) {
        if (widths[l] && widths[l + 1] > SIZE_MAX / widths[l]) refuse("the network is too large");
        made.weights[l] = get(widths[l] * widths[l + 1], sizeof(double));
        made.biases[l] = get(widths[l + 1], sizeof(double));
    }
    return made;
}

/* SIR-1: the weights and biases. */
static network read_parameters(const json *in) {
    array weights[MOST_LAYERS], biases[MOST_LAYERS];
    size_t widths[MOST_LAYERS + 1] = {0}, layers = 0;
    char name[32];
    for (; layers < MOST_LAYERS; layers++) {
        snprintf(name, sizeof name, "weight_%u", (unsigned)layers);
        if (!find(in, name)) break;
        weights[layers] = array_in(in, name, 2);
        snprintf(name, sizeof name, "bias_%u", (unsigned)layers);
        biases[layers] = array_in(in, name, 1);
        if (!layers) widths[0] = weights[0].shape[1];
        widths[layers + 1] = weights[layers].shape[0];
        if (weights[layers].shape[1] != widths[layers] || biases[layers].shape[0] != widths[layers + 1])
            refuse("the layers do not fit");
    }
    network made = new_network(layers, widths);
    for (size_t l = 0; l < layers; l++) {
        made.weights[l] = weights[l].values;
        made.biases[l] = biases[l].values;
    }
    return made;
}

static network read_network(const json *in) {
    network made = read_parameters(in);
    made.omega_first = number(in, "omega_0_first");
    made.omega_hidden = number(in, "omega_0_hidden");
    return made;
}

static void answer_network(const network *n, const char *weight, const char *bias) {
    char name[32];
    for (size_t l = 0; l < n->layers; l++) {
        size_t in = n->widths[l], out = n->widths[l + 1];
        snprintf(name, sizeof name, "%s_%u", weight, (unsigned)l);
        answer_array(name, (array){.axes = 2, .shape = {out, in}, .count = out * in, .values = n->weights[l]});
        snprintf(name, sizeof name, "%s_%u", bias, (unsigned)l);
        answer_array(name, (array){.axes = 1, .shape = {out}, .count = out, .values = n->biases[l]});
    }
}

/* ADM-1, ADM-2 */
static void adam(double *theta, double g, double *m, double *v, double rate, double growth_1, double growth_2) {
    *m = 0.9 * *m + (1 - 0.9) * g;
    *v = 0.999 * *v + (1 - 0.999) * g * g;
    *theta -= rate * (*m / growth_1) / (sqrt(*v / growth_2) + 1e-8);
}

/* SIN-7: beyond the domain the emitted sine is 0; within it any sine is near enough (PRO-4). */
static double emitted_sine(double x) { return fabs(x) > 12800 && isfinite(x) ? 0 : sin(x); }

/* ---- networks of integers: WHO -------------------------------------------------------------------------- */

enum { INPUT_LEVELS = 127, MOST_FRACTION = 8, MOST_WIDTH = 8192 };
static const double TURN = 16777216, MOST_INT = 2147483647;

/* WHO-1: weights and biases are integers here, in double precision, which holds them. */
typedef struct {
    network of;
    double *factors[MOST_LAYERS], *multiples[MOST_LAYERS], amplitude; /* multiples: factors before the modulo */
    int fraction;
} whole;

/* WHO-2: of a feature in [-1, 1] that is rounded to single precision; the sum is exact. */
static double whole_input(double x) { return floor(INPUT_LEVELS * x + 0.5); }

/* WHO-5 */
typedef struct {
    uint32_t amplitude, c1, c3, c5;
    int shift;
} polynomial;

static const polynomial SINES[] = {{127, 51053, 20871, 2332, 24}, {511, 51355, 20996, 2347, 22}};

static const polynomial *sine_with(double amplitude) {
    for (size_t i = 0; i < sizeof SINES / sizeof *SINES; i++)
        if (SINES[i].amplitude == amplitude) return &SINES[i];
    refuse("an amplitude is 127 or 511");
}

static double amplitude_in(const json *in) { return whole_of(field(in, "amplitude"), 0, 511, "amplitude"); }

static int32_t whole_sine(const polynomial *s, uint32_t phase) {
    uint32_t k = phase >> 22 & 1 ? ~phase : phase, m = k >> 6 & 0xffff, z = m * m >> 16;
    uint32_t slope = s->c1 - (z * (s->c3 - (z * s->c5 >> 16)) >> 16);
    int32_t size = (int32_t)((m * slope + (1u << (s->shift - 1))) >> s->shift);
    return phase >> 23 & 1 ? -size : size;
}

static double largest_input(const whole *n, size_t layer) { return layer ? n->amplitude : INPUT_LEVELS; }

static bool is_last(const whole *n, size_t layer) { return layer + 1 == n->of.layers; }

/* WHO-3: the largest that a sum of row i can be. */
static double largest_sum(const whole *n, size_t layer, size_t i) {
    size_t in = n->of.widths[layer];
    double found = 0;
    for (size_t k = 0; k < in; k++) found += fabs(n->of.weights[layer][i * in + k]);
    return found * largest_input(n, layer);
}

static bool whole_within(const double *values, size_t count, double least, double most) {
    for (size_t i = 0; i < count; i++)
        if (!(values[i] >= least && values[i] <= most) || floor(values[i]) != values[i]) return false;
    return true;
}

/* WHO-1, WHO-3, WHO-6: return what is wrong with a network, or nothing. */
static const char *wrong(const whole *n) {
    for (size_t l = 0; l < n->of.layers; l++) {
        size_t in = n->of.widths[l], out = n->of.widths[l + 1];
        bool last = is_last(n, l);
        if (!whole_within(n->of.weights[l], in * out, -127, 127)) return "a weight is not in [-127, 127]";
        if (!whole_within(n->factors[l], out, 0, TURN - 1)) return "a factor is not in [0, 2^24)";
        if (!whole_within(n->of.biases[l], out, last ? -TURN : 0, TURN - 1)) return "a bias is out of its range";
        for (size_t i = 0; i < out; i++) {
            double most = largest_sum(n, l, i), color = most * n->factors[l][i] + fabs(n->of.biases[l][i]);
            if (most >= TURN) return "a sum can reach 2^24";
            if (last && color > MOST_INT) return "a colour can leave int32";
        }
    }
    return NULL;
}

/* WHO-6: double precision holds int32. */
static double whole_color(double u, int fraction) {
    return floor(ldexp(clamp(u, 0, ldexp(1, 16 + fraction)), -fraction)) / 65536;
}

static uint32_t word_of(double x) { return (uint32_t)(int32_t)x; }

/* WHO-3, WHO-4, WHO-5, WHO-6: what a layer gives. */
static double *whole_layer(const whole *n, size_t layer, const double *x) {
    size_t in = n->of.widths[layer], out = n->of.widths[layer + 1];
    const polynomial *sine = sine_with(n->amplitude);
    double *y = get(out, sizeof *y);
    for (size_t i = 0; i < out; i++) {
        double a = 0, m = n->factors[layer][i], b = n->of.biases[layer][i];
        for (size_t k = 0; k < in; k++) a += n->of.weights[layer][i * in + k] * x[k];
        if (is_last(n, layer)) y[i] = whole_color(a * m + b, n->fraction);
        else y[i] = whole_sine(sine, word_of(a) * word_of(m) + word_of(b));
    }
    return y;
}

/* WHO-8: the neighbours of a tap that is rounded, by rows below it and columns ahead of it, and their shares. */
static const struct {
    long below, ahead;
    double share;
} NEIGHBOURS[] = {{0, 1, 7}, {1, -1, 3}, {1, 0, 5}, {1, 1, 1}};

/* WHO-8: round the taps of one channel, whose first is row[0], in place. */
static void diffuse(double *row, long size, long channels) {
    for (long y = 0; y < size; y++)
        for (long step = 0; step < size; step++) {
            long way = y % 2 ? -1 : 1, x = y % 2 ? size - 1 - step : step;
            double *tap = row + (y * size + x) * channels, value = *tap, total = 0;
            *tap = clamp(rint(value), -127, 127);
            for (int pass = 0; pass < 2; pass++)
                for (size_t i = 0; i < sizeof NEIGHBOURS / sizeof *NEIGHBOURS; i++) {
                    long below = NEIGHBOURS[i].below, ahead = way * NEIGHBOURS[i].ahead;
                    if (y + below >= size || x + ahead < 0 || x + ahead >= size) continue;
                    if (!pass) total += NEIGHBOURS[i].share;
                    else tap[(below * size + ahead) * channels] += (value - *tap) * (NEIGHBOURS[i].share / total);
                }
        }
}

/* WHO-7: what a sum of 1 is in units of a phase, or of a colour. */
static double unit_of(const network *n, const whole *made, size_t layer) {
    return is_last(made, layer) ? ldexp(1, 16 + made->fraction) : omega(n, layer) / (2 * PI) * TURN;
}

/* WHO-7: round a layer of n to one of made, whose fraction, widths and amplitude are known. */
static void round_layer(const network *n, whole *made, size_t layer, size_t size) {
    size_t in = n->widths[layer], out = n->widths[layer + 1], channels = in / (size * size);
    bool last = is_last(made, layer);
    double g = unit_of(n, made, layer);
    double largest = largest_input(made, layer), most = floor((TURN - 1) / largest) - 2 * (double)in;
    for (size_t i = 0; i < out; i++) {
        double *row = made->of.weights[layer] + i * in, top = 0, sums = 0;
        for (size_t k = 0; k < in; k++) {
            row[k] = n->weights[layer][i * in + k] * (g / largest);
            top = fmax(top, fabs(row[k]));
            sums += fabs(row[k]);
        }
        double m = ceil(fmax(1, fmax(top / 127, sums / most)));
        double b = rint(n->biases[layer][i] * g + (last ? ldexp(1, made->fraction - 1) : 0));
        for (size_t k = 0; k < in; k++) row[k] /= m;
        for (size_t k = 0; k < in && layer; k++) row[k] = rint(row[k]);
        for (size_t c = 0; c < channels && !layer; c++) diffuse(row + c, (long)size, (long)channels);
        made->multiples[layer][i] = m;
        made->factors[layer][i] = last ? m : fmod(m, TURN);
        made->of.biases[layer][i] = last ? b : b - TURN * floor(b / TURN);
    }
}

static whole new_whole(const network *n, double amplitude) {
    whole made = {.of = new_network(n->layers, n->widths), .amplitude = amplitude, .fraction = MOST_FRACTION};
    sine_with(amplitude);
    for (size_t l = 0; l < n->layers; l++) {
        made.factors[l] = get(n->widths[l + 1], sizeof(double));
        made.multiples[l] = get(n->widths[l + 1], sizeof(double));
    }
    return made;
}

/* WHO-7: with the largest fraction that is possible. */
static whole rounded(const network *n, size_t size, double amplitude) {
    whole made = new_whole(n, amplitude);
    if (n->widths[0] % (size * size)) refuse("the first layer has no window of this size");
    for (size_t l = 0; l <= n->layers; l++)
        if (n->widths[l] > MOST_WIDTH) refuse("a layer has more than %d numbers", MOST_WIDTH);
    for (size_t l = 0; l + 1 < n->layers; l++) round_layer(n, &made, l, size);
    for (; made.fraction >= 0; made.fraction--) {
        round_layer(n, &made, n->layers - 1, size);
        if (!wrong(&made)) return made;
    }
    refuse("with no fraction it has an integer form: %s", wrong(&made));
}

/* WHO-14: C of inputs x (count, in), as R (in, in) of C = R^T R for inputs in order of their variance. */
static double *root_of(const double *x, size_t count, size_t in, const double *mean, size_t *order) {
    double *c = get(in * in, sizeof *c), *root = get(in * in, sizeof *root), spread = 0;
    for (size_t k = 0; k < count; k++)
        for (size_t i = 0; i < in; i++)
            for (size_t j = 0; j < in; j++)
                c[i * in + j] += (x[k * in + i] - mean[i]) * (x[k * in + j] - mean[j]) / (double)count;
    for (size_t i = 0; i < in; i++) spread += c[i * in + i] / (double)in;
    for (size_t i = 0; i < in; i++) {
        size_t at = i;
        c[i * in + i] += fmax(spread, 1) / 100;
        for (; at && c[order[at - 1] * in + order[at - 1]] > c[i * in + i]; at--) order[at] = order[at - 1];
        order[at] = i;
    }
    for (size_t i = 0; i < in; i++)
        for (size_t j = i; j < in; j++) {
            double left = c[order[i] * in + order[j]];
            for (size_t k = 0; k < i; k++) left -= root[k * in + i] * root[k * in + j];
            root[i * in + j] = j == i ? sqrt(left) : left / root[i * in + i];
        }
    return root;
}

/* WHO-14: the integers q near a row of real weights w, both in the order of R; y is E[(n - E n)(s - w n)]. */
static void choose(const double *root, size_t in, double *w, double *y, double *q) {
    for (size_t i = 0; i < in; i++) {
        for (size_t k = 0; k < i; k++) y[i] -= root[k * in + i] * y[k];
        y[i] /= root[i * in + i];
    }
    for (size_t i = in; i-- > 0;) {
        for (size_t k = i + 1; k < in; k++) y[i] -= root[i * in + k] * y[k];
        y[i] /= root[i * in + i];
        w[i] += y[i];
    }
    for (size_t i = in; i-- > 0;) {
        double handed = 0;
        for (size_t j = i + 1; j < in; j++) handed += root[i * in + j] * (w[j] - q[j]);
        q[i] = clamp(rint(w[i] + handed / root[i * in + i]), -127, 127);
    }
}

/* WHO-14: round a layer on inputs: x of the network that is made, sums in units of a phase or a colour. */
static void round_layer_on(const network *n, whole *made, size_t layer, const double *x, const double *sums,
                           size_t count) {
    size_t in = n->widths[layer], out = n->widths[layer + 1], *order = get(in, sizeof *order);
    double *mean = get(in, sizeof *mean), *w = get(in, sizeof *w), *y = get(in, sizeof *y), *q = get(in, sizeof *q);
    bool last = is_last(made, layer);
    double g = unit_of(n, made, layer);
    for (size_t k = 0; k < count; k++)
        for (size_t i = 0; i < in; i++) mean[i] += x[k * in + i] / (double)count;
    const double *root = root_of(x, count, in, mean, order);
    for (size_t o = 0; o < out; o++) {
        double m = made->multiples[layer][o], bias = 0, *row = made->of.weights[layer] + o * in;
        for (size_t i = 0; i < in; i++) {
            w[i] = n->weights[layer][o * in + order[i]] * (g / largest_input(made, layer)) / m;
            y[i] = 0;
        }
        for (size_t k = 0; k < count; k++) {
            double missing = sums[k * out + o] / m;
            for (size_t i = 0; i < in; i++) missing -= w[i] * x[k * in + order[i]];
            for (size_t i = 0; i < in; i++)
                y[i] += (x[k * in + order[i]] - mean[order[i]]) * missing / (double)count;
        }
        choose(root, in, w, y, q);
        for (size_t i = 0; i < in; i++) row[order[i]] = q[i];
        for (size_t k = 0; k < count; k++) {
            double held = 0;
            for (size_t i = 0; i < in; i++) held += row[i] * x[k * in + i];
            bias += (sums[k * out + o] - held * m) / (double)count;
        }
        bias = rint(bias + (last ? ldexp(1, made->fraction - 1) : 0));
        made->of.biases[layer][o] = last ? bias : bias - TURN * floor(bias / TURN);
    }
}

/* WHO-14: on windows in [-1, 1]. */
static whole rounded_on(const network *n, size_t size, double amplitude, const array *windows) {
    whole plain = rounded(n, size, amplitude), made = rounded(n, size, amplitude);
    size_t count = windows->shape[0];
    const double *values = windows->values;
    double *x = get(windows->count, sizeof *x);
    for (size_t i = 0; i < windows->count; i++) x[i] = whole_input(values[i]);
    for (size_t l = 0; l < n->layers; l++) {
        size_t in = n->widths[l], out = n->widths[l + 1];
        bool last = is_last(&made, l);
        double g = unit_of(n, &made, l);
        double *sums = get(count * out, sizeof *sums), *next = get(count * out, sizeof *next);
        for (size_t k = 0; k < count; k++)
            for (size_t o = 0; o < out; o++) {
                double sum = n->biases[l][o];
                for (size_t i = 0; i < in; i++) sum += n->weights[l][o * in + i] * values[k * in + i];
                sums[k * out + o] = sum * g;
            }
        round_layer_on(n, &made, l, x, sums, count);
        if (last) break;
        for (size_t k = 0; k < count; k++)
            memcpy(next + k * out, whole_layer(&made, l, x + k * in), out * sizeof *next);
        for (size_t i = 0; i < count * out; i++) sums[i] = sin(sums[i] / TURN * (2 * PI));
        values = sums;
        x = next;
    }
    return wrong(&made) ? plain : made;
}

static whole read_whole(const json *in) {
    network given = read_parameters(in);
    whole made = new_whole(&given, amplitude_in(in));
    char name[32];
    made.of = given;
    made.fraction = (int)whole_of(field(in, "fraction"), 0, MOST_FRACTION, "the fraction");
    for (size_t l = 0; l < given.layers; l++) {
        snprintf(name, sizeof name, "factor_%u", (unsigned)l);
        array factors = array_in(in, name, 1);
        if (factors.count != given.widths[l + 1]) refuse("factors do not fit the layer");
        made.factors[l] = factors.values;
    }
    if (wrong(&made)) refuse("%s", wrong(&made));
    return made;
}

/* ---- metrics: MET --------------------------------------------------------------------------------------- */

static double squared(double x) { return x * x; }
static double error_mse(double x, double r) { return squared(x - r); }
static double error_relmse(double x, double r) { return squared(x - r) / (r * r + 0.01); }
static double error_smape(double x, double r) { return fabs(x - r) / (fabs(x) + fabs(r) + 0.01); }

/* MET-3, MET-6, MET-7 */
static double mean_error(const array *x, const array *r, double (*error)(double, double)) {
    double total = 0;
    for (size_t i = 0; i < x->count; i++) total += error(x->values[i], r->values[i]);
    return total / (double)x->count;
}

/* MET-5, for L = 1 */
static double ssim(const array *x, const array *r) {
    enum { SIZE = 11 };
    double weights[SIZE], total = 0, found = 0;
    size_t rows = x->shape[0], columns = x->shape[1], channels = x->shape[2];
    if (rows < SIZE || columns < SIZE) refuse("the picture is smaller than a window of 11 x 11");
    for (int i = 0; i < SIZE; i++) total += weights[i] = exp(-0.5 * squared((i - 5) / 1.5));
    for (int i = 0; i < SIZE; i++) weights[i] /= total;
    for (size_t y = 0; y + SIZE <= rows; y++)
        for (size_t column = 0; column + SIZE <= columns; column++)
            for (size_t c = 0; c < channels; c++) {
                double mx = 0, mr = 0, vx = 0, vr = 0, both = 0;
                for (int pass = 0; pass < 2; pass++) /* means, then what differs from them */
                    for (size_t k = 0; k < SIZE * SIZE; k++) {
                        size_t at = ((y + k / SIZE) * columns + column + k % SIZE) * channels + c;
                        double w = weights[k / SIZE] * weights[k % SIZE], a = x->values[at], b = r->values[at];
                        if (!pass) {
                            mx += w * a;
                            mr += w * b;
                        } else {
                            vx += w * squared(a - mx);
                            vr += w * squared(b - mr);
                            both += w * (a - mx) * (b - mr);
                        }
                    }
                double c1 = squared(0.01), c2 = squared(0.03);
                found += (2 * mx * mr + c1) * (2 * both + c2) / ((mx * mx + mr * mr + c1) * (vx + vr + c2));
            }
    return found / (double)((rows - SIZE + 1) * (columns - SIZE + 1) * channels);
}

/* MET-10 */
static double blurred(const array *x, const array *r) {
    size_t sides[2] = {x->shape[0], x->shape[1]}, channels = x->shape[2];
    double *d = get(x->count, sizeof *d), *after = get(x->count, sizeof *d), total = 0;
    for (size_t i = 0; i < x->count; i++) d[i] = x->values[i] - r->values[i];
    for (int axis = 0; axis < 2; axis++) {
        size_t step = axis ? channels : sides[1] * channels;
        for (size_t i = 0; i < x->count; i++) {
            int at = (int)(i / step % sides[axis]);
            double sum = 0, weights = 0;
            for (int k = -24; k <= 24; k++) {
                if (at + k < 0 || at + k >= (int)sides[axis]) continue;
                double weight = exp(-0.5 * squared(k / 8.0));
                weights += weight;
                sum += weight * d[(long)i + k * (long)step];
            }
            after[i] = sum / weights;
        }
        memcpy(d, after, x->count * sizeof *d);
    }
    for (size_t i = 0; i < x->count; i++) total += squared(d[i]);
    return sqrt(total / (double)x->count);
}

/* MET-1 */
static void read_pair(const json *in, array *x, array *r) {
    *x = array_in(in, "image", 3);
    *r = array_in(in, "reference", 3);
    if (memcmp(x->shape, r->shape, 3 * sizeof *x->shape) || !x->count) refuse("the pictures differ in shape");
    for (size_t i = 0; i < x->count; i++)
        if (!isfinite(x->values[i]) || !isfinite(r->values[i])) refuse("a number is not finite");
}

/* ---- model files: MOD, DEN ------------------------------------------------------------------------------ */

typedef struct {
    network net;
    features shown;
    window win;
    scales how;
} model;

typedef struct {
    const json *name;
    const char *type;
    size_t axes, shape[AXES], count, begin, end;
} tensor;

typedef struct {
    const unsigned char *data;
    size_t length, count;
    tensor *tensors;
    const json *texts;
} container;

static size_t element_size(const char *type) {
    static const char *const types[] = {"BOOL", "U8",  "I8",   "F8_E5M2", "F8_E4M3", "I16", "U16", "F16",
                                        "BF16", "I32", "U32",  "F32",     "F64",     "I64", "U64"};
    static const size_t sizes[] = {1, 1, 1, 1, 1, 2, 2, 2, 2, 4, 4, 4, 8, 8, 8};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++)
        if (!strcmp(types[i], type)) return sizes[i];
    refuse("%.20s is no type of numbers", type);
}

static size_t size_of(const json *from) {
    return (size_t)whole_of(from, 0, 9e15, "a size");
}

static tensor read_tensor(const json *name, const json *from, size_t length) {
    check_keys(from, " dtype shape data_offsets ");
    const json *shape = list_of(field(from, "shape"), SIZE_MAX, "shape");
    const json *offsets = list_of(field(from, "data_offsets"), 2, "data_offsets");
    tensor made = {.name = name, .type = text(from, "dtype"), .axes = shape->length, .count = 1};
    for (size_t i = 0; i < shape->length; i++) {
        size_t side = size_of(shape->items[i]);
        if (i < AXES) made.shape[i] = side;
        if (side && made.count > SIZE_MAX / 16 / side) refuse("the tensor is too large");
        made.count *= side;
    }
    made.begin = size_of(offsets->items[0]);
    made.end = size_of(offsets->items[1]);
    if (made.end > length || made.begin > made.end) refuse("the tensor is not in the file");
    if (made.end - made.begin != made.count * element_size(made.type)) refuse("the tensor has another size");
    return made;
}

static int by_begin(const void *a, const void *b) {
    const tensor *one = a, *two = b;
    if (one->begin != two->begin) return one->begin < two->begin ? -1 : 1;
    return one->end < two->end ? -1 : one->end > two->end;
}

/* MOD-1, MOD-6: tensors lie one after another, without gaps, to the end. */
static container read_container(const unsigned char *content, size_t length) {
    uint64_t header = 0;
    container made = {0};
    if (length < 8) refuse("it is too short");
    if (length > (size_t)256 << 20) refuse("it is larger than 256 MiB");
    for (int i = 7; i >= 0; i--) header = header << 8 | content[i];
    if (header > length - 8) refuse("the header is longer than the file");
    if (!header || content[8] != '{') refuse("the header is no object");
    const json *head = parse((const char *)content + 8, (size_t)header);
    made.data = content + 8 + header;
    made.length = length - 8 - (size_t)header;
    made.tensors = get(head->length, sizeof *made.tensors);
    for (size_t i = 0; i < head->length; i++)
        if (strcmp(head->names[i]->text, "__metadata__"))
            made.tensors[made.count++] = read_tensor(head->names[i], head->items[i], made.length);
    qsort(made.tensors, made.count, sizeof *made.tensors, by_begin);
    size_t at = 0;
    for (size_t i = 0; i < made.count; i++) {
        if (made.tensors[i].begin != at) refuse("tensors overlap, or leave a gap");
        at = made.tensors[i].end;
    }
    if (at != made.length) refuse("there are bytes after the last tensor");
    made.texts = field(head, "__metadata__");
    if (made.texts->type != J_OBJECT) refuse("__metadata__ is no object");
    for (size_t i = 0; i < made.texts->length; i++)
        if (made.texts->items[i]->type != J_TEXT) refuse("__metadata__ maps texts to texts");
    return made;
}

static const tensor *find_tensor(const container *in, const char *name) {
    for (size_t i = 0; i < in->count; i++)
        if (!strcmp(in->tensors[i].name->text, name)) return &in->tensors[i];
    return NULL;
}

static double *parameters(const container *in, const tensor *from, size_t axes, const char *type) {
    if (from->axes != axes || strcmp(from->type, type) || (strcmp(type, "F32") && strcmp(type, "F64")))
        refuse("parameters must be float32 or float64, all of them alike");
    double *made = get(from->count, sizeof *made);
    for (size_t i = 0; i < from->count; i++) {
        if (!strcmp(type, "F32")) {
            made[i] = little_endian_float(in->data + from->begin + 4 * i);
        } else {
            uint64_t bits = 0;
            for (size_t k = 8; k-- > 0;) bits = bits << 8 | in->data[from->begin + 8 * i + k];
            memcpy(&made[i], &bits, sizeof bits);
        }
        if (!(fabs(made[i]) <= 1e12)) refuse("a parameter is not finite, or beyond 1e12");
    }
    return made;
}

/* MOD-2: as many layers as there are tensors layer<l>.weight, from 0 on. */
static network read_layers(const container *in) {
    size_t layers = 0, widths[MOST_LAYERS + 1] = {0};
    double *weights[MOST_LAYERS], *biases[MOST_LAYERS];
    const char *type = NULL;
    char name[40];
    for (size_t i = 0; i < in->count; i++) {
        const char *text_end = in->tensors[i].name->text + in->tensors[i].name->length;
        layers += in->tensors[i].name->length >= 7 && !strcmp(text_end - 7, ".weight");
    }
    if (!layers || layers > MOST_LAYERS) refuse("a network has 1 to %d layers", MOST_LAYERS);
    for (size_t l = 0; l < layers; l++) {
        snprintf(name, sizeof name, "layer%u.weight", (unsigned)l);
        const tensor *weight = find_tensor(in, name);
        snprintf(name, sizeof name, "layer%u.bias", (unsigned)l);
        const tensor *bias = find_tensor(in, name);
        if (!weight || !bias) refuse("layer %u is not complete", (unsigned)l);
        if (!type) type = weight->type;
        weights[l] = parameters(in, weight, 2, type);
        biases[l] = parameters(in, bias, 1, type);
        if (!l) widths[0] = weight->shape[1];
        if (!weight->count || weight->shape[1] != widths[l] || weight->shape[0] != bias->shape[0])
            refuse("the layers do not fit");
        widths[l + 1] = weight->shape[0];
    }
    network made = new_network(layers, widths);
    memcpy(made.weights, weights, layers * sizeof *weights);
    memcpy(made.biases, biases, layers * sizeof *biases);
    return made;
}

/* MOD-2: a number of JSON, without spaces. */
static double decimal(const json *in, const char *name) {
    const json *from = field(in, name);
    if (from->type != J_TEXT || strspn(from->text, "0123456789+-.eE") != from->length)
        refuse("%s must be a decimal", name);
    const json *found = parse(from->text, from->length);
    if (found->type != J_NUMBER || !(fabs(found->number) < HUGE_VAL)) refuse("%s must be a finite decimal", name);
    return found->number;
}

/* RDG-3: requests have numbers as texts too, files do not. */
static void check_numbers(const json *in) {
    for (size_t i = 0; i < in->length; i++) {
        if (in->items[i]->type == J_LIST) check_numbers(in->items[i]);
        else if (in->items[i]->type != J_NUMBER) refuse("a number is expected");
    }
}

static const json *json_text(const json *in, const char *name) {
    const char *content = text(in, name);
    return parse(content, strlen(content));
}

static void check_omega(double omega) {
    if (!(omega > 0 && omega <= 1e12)) refuse("omega_0 must be positive, and at most 1e12");
}

/* MOD-2, MOD-6, DEN-1 */
static model read_model(const char *base64) {
    size_t length;
    const unsigned char *content = from_base64(base64, &length);
    container in = read_container(content, length);
    if (strcmp(text(in.texts, "format"), "wamnet-model")) refuse("it is no model");
    const char *version = text(in.texts, "version");
    bool second = !strcmp(version, "2");
    if (!second && strcmp(version, "1")) refuse("it has another version");
    const json *named = find(in.texts, "activation");
    if (!named && second) refuse("a model of version 2 must name its activation");
    const char *activation = named ? text_of(named, "activation") : "sine";
    bool rectifies = !strcmp(activation, "relu");
    if ((rectifies && !second) || (!rectifies && strcmp(activation, "sine"))) refuse("it has another activation");
    model made = {.net = read_layers(&in)};
    made.net.rectifies = rectifies;
    made.net.omega_first = decimal(in.texts, "omega_0_first");
    made.net.omega_hidden = decimal(in.texts, "omega_0_hidden");
    check_omega(made.net.omega_first);
    check_omega(made.net.omega_hidden);
    const json *names = list_of(json_text(in.texts, "features"), SIZE_MAX, "features");
    for (size_t i = 0; i < names->length; i++) {
        const char *name = text_of(names->items[i], "a feature");
        add_feature(&made.shown, name, strlen(name));
    }
    const json *window_text = json_text(in.texts, "window"), *scales_text = json_text(in.texts, "normalization");
    check_keys(window_text, " size border ");
    check_keys(scales_text, " exposure_stops depth_scale position_center position_scale ");
    made.win = read_window(window_text);
    check_numbers(scales_text);
    made.how = read_scales(scales_text);
    if (!names->length || made.net.widths[0] != made.win.size * made.win.size * made.shown.channels
        || made.net.widths[made.net.layers] != 3)
        refuse("the network does not fit its features and window");
    return made;
}

/* DEN-2: NaN stays NaN. */
static void denoise_pixel(const model *m, const array *image, size_t x, size_t y, double *color) {
    double *found = get(m->net.widths[0], sizeof *found);
    window_at(image, m->win, x, y, found);
    for (size_t l = 0; l < m->net.layers; l++) found = forward_layer(&m->net, l, found);
    for (int i = 0; i < 3; i++) color[i] = clamp(found[i], 0, 1);
}

/* ---- kinds of cases: spec/vectors/README.md ------------------------------------------------------------- */

static void do_random_block(const json *in) {
    uint32_t seed = counter(in, "seed"), pixel = counter(in, "pixel"), sample = counter(in, "sample");
    words found = random_block(seed, pixel, sample, counter(in, "block"));
    double floats[4];
    for (int i = 0; i < 4; i++) floats[i] = uniform(found.w[i]);
    answer_wholes("words", found.w, 4);
    answer_array("floats", (array){.axes = 1, .shape = {4}, .count = 4, .values = floats});
}

static void do_pcg4d(const json *in) {
    words v = {{counter(in, "x"), counter(in, "y"), counter(in, "z"), counter(in, "w")}};
    answer_wholes("words", pcg4d(v).w, 4);
}

static void do_float(const json *in) { answer_number("float", uniform(counter(in, "word"))); }

static void do_scrambled(const json *in) {
    uint32_t found = scrambled(counter(in, "fraction"), counter(in, "key"));
    answer_wholes("words", &found, 1);
}

static void do_point(const json *in) {
    uint32_t found[4];
    for (int d = 0; d < 4; d++) found[d] = sobol(counter(in, "index"), d);
    answer_wholes("words", found, 4);
}

static void do_vector(const json *in) {
    v3 a = vec_in(in, "a"), b = vec_in(in, "b"), c = vec_in(in, "c");
    const v3 rows[3] = {a, b, c};
    answer_number("inner", dot(a, b));
    answer_vec("outer", cross(a, b));
    answer_vec("unit", unit(a));
    answer_vec("rotated", turned(rows, c));
    answer_number("largest", largest(a));
    answer_number("smallest", -largest(scale(a, -1)));
    answer_vec("scaled", scale(a, b.c[0]));
}

static void do_sobol(const json *in) {
    uint32_t seed = counter(in, "seed"), pixel = counter(in, "pixel"), sample = counter(in, "sample");
    words found = sobol_block(seed, pixel, sample, counter(in, "block"));
    double floats[4];
    for (int i = 0; i < 4; i++) floats[i] = uniform(found.w[i]);
    answer_array("floats", (array){.axes = 1, .shape = {4}, .count = 4, .values = floats});
}

static void do_disk(const json *in) {
    double x, y;
    concentric_disk(number(in, "u0"), number(in, "u1"), &x, &y);
    answer_number("x", x);
    answer_number("y", y);
}

static void do_hemisphere(const json *in) {
    v3 found = cosine_hemisphere(number(in, "u0"), number(in, "u1"));
    answer_vec("direction", found);
    answer_number("pdf", found.c[2] / PI);
}

static void do_cauchy(const json *in) {
    double k = number(in, "concentration");
    v3 found = spherical_cauchy(number(in, "u0"), number(in, "u1"), k);
    answer_vec("direction", found);
    answer_number("pdf", spherical_cauchy_pdf(1 - found.c[2], k));
}

static void do_quad(const json *in) {
    v3 u = vec_in(in, "edge_u"), v = vec_in(in, "edge_v");
    answer_vec("point", quad_point(number(in, "u0"), number(in, "u1"), vec_in(in, "corner"), u, v));
    answer_number("pdf", 1 / length(cross(u, v)));
}

static void do_discrete(const json *in) {
    static const double sums[] = {0.125, 0.125, 0.625, 1};
    size_t index = discrete(number(in, "u0"), sums, 4);
    answer_number("index", (double)index);
    answer_number("probability", discrete_probability(index, sums));
}

static void do_tangents(const json *in) {
    v3 t, other;
    tangents(vec_in(in, "normal"), &t, &other);
    answer_vec("tangent", t);
    answer_vec("bitangent", other);
}

static void do_to_world(const json *in) {
    v3 vector = vec_in(in, "vector"), normal = vec_in(in, "normal");
    answer_vec("world", to_world(vector, normal));
    answer_vec("local", to_local(vector, normal));
}

static void do_axes(const json *in) {
    camera c = {vec_in(in, "position"), vec_in(in, "look_at"), vec_in(in, "up"), number(in, "vertical_fov_deg")};
    v3 axis[3];
    answer_number("tan_half_fov", axes(&c, axis));
    answer_vec("forward", axis[0]);
    answer_vec("right", axis[1]);
    answer_vec("up", axis[2]);
}

static void do_camera(const json *in) {
    camera c = {vec(0.5, 1, 4), vec(0, -0.2, 0), UP, 41};
    answer_vec("origin", c.position);
    answer_vec("direction", camera_direction(&c, 97, 64, number(in, "x") + number(in, "u"),
                                             number(in, "y") + number(in, "v")));
}

/* The scenes of the kinds of intersections, as the page of formats gives them. */
static const part TEST_SPHERE = {.center = {{0.25, -0.5, 0.125}}, .radius = 0.75};
static const part TEST_QUAD = {.corner = {{-0.5, 0.25, -0.75}},
                               .edge_u = {{1.5, 0, 0.25}}, .edge_v = {{0.25, 0, 2}}};
static const part TEST_BOX = {.center = {{0.25, -0.5, 0.125}}, .half = {{0.5, 0.75, 1}},
                              .rotation = {{{1, 0, 0}}, {{0, 1, 0}}, {{0, 0, 1}}}};
static const v3 TEST_TURN[3] = {{{0.8, 0.6, 0}}, {{-0.6, 0.8, 0}}, {{0, 0, 1}}};
static const room TEST_ROOM = {.given = true, .low = {{-2, -1, -3}}, .high = {{2, 1.5, 3}}};
static const part MIXED_BOX = {.center = {{0, -0.5, 0}}, .half = {{1, 0.5, 1}},
                               .rotation = {{{1, 0, 0}}, {{0, 1, 0}}, {{0, 0, 1}}}};
static const part MIXED_SPHERE = {.center = {{0, 0.5, 0}}, .radius = 0.5};
static const part MIXED_QUAD = {.corner = {{-1, 1, -1}}, .edge_u = {{2, 0, 0}}, .edge_v = {{0, 0, 2}}};

static const room HALL = {.given = true, .low = {{-3, -1, -3}}, .high = {{3, 3, 3}}};
static const part HALL_LIGHT = {.corner = {{-0.5, 2, -0.5}}, .edge_u = {{1, 0, 0}}, .edge_v = {{0, 0, 1}},
                                .color = {{0.5, 0.5, 0.5}}, .power = 1};

static parts one(const part *from) {
    parts made = {get(1, sizeof(part)), 1};
    *made.items = *from;
    return made;
}

static void meet(const json *in, const scene *s, bool normal, bool surface_too) {
    world w = build(*s, (settings){0});
    hit h = closest(&w, vec_in(in, "origin"), vec_in(in, "direction"));
    answer_number("t", h.t);
    if (normal) answer_vec("normal", h.normal);
    if (surface_too) answer_number("surface", (double)h.id);
}

static void do_slabs(const json *in) {
    v3 enter, leave;
    slabs(TEST_BOX.center, TEST_BOX.half, vec_in(in, "origin"), vec_in(in, "direction"), &enter, &leave);
    answer_vec("enter", enter);
    answer_vec("leave", leave);
}

static void do_sphere(const json *in) {
    scene s = {.spheres = one(&TEST_SPHERE)};
    meet(in, &s, false, false);
}

static void do_plane(const json *in) {
    scene s = {.quads = one(&TEST_QUAD)};
    meet(in, &s, false, false);
}

static void do_box(const json *in) {
    scene s = {.boxes = one(&TEST_BOX)};
    meet(in, &s, true, false);
}

static void do_turned_box(const json *in) {
    scene s = {.boxes = one(&TEST_BOX)};
    memcpy(s.boxes.items->rotation, TEST_TURN, sizeof TEST_TURN);
    meet(in, &s, true, false);
}

static void do_room(const json *in) {
    scene s = {.walls = TEST_ROOM};
    meet(in, &s, true, true);
}

static void do_nearest(const json *in) {
    scene s = {.boxes = one(&MIXED_BOX), .spheres = one(&MIXED_SPHERE), .quads = one(&MIXED_QUAD)};
    meet(in, &s, true, true);
}

static void do_occluded(const json *in) {
    scene s = {.walls = HALL, .boxes = one(&MIXED_BOX), .spheres = one(&MIXED_SPHERE), .quads = one(&MIXED_QUAD),
               .lights = one(&HALL_LIGHT)};
    world w = build(s, (settings){0});
    answer_number("occluded", occluded(&w, vec_in(in, "origin"), vec_in(in, "direction"), number(in, "distance")));
}

static site site_in(const json *in, material m) {
    return (site){vec_in(in, "wo"), vec_in(in, "normal"), vec_in(in, "reflectance"), true, m};
}

static void answer_scattered(const json *in, const site *s) {
    scattered found = sample_material(s, number(in, "u0"), number(in, "u1"), number(in, "u_choice"));
    answer_vec("direction", found.direction);
    answer_vec("beta", found.factor);
    answer_number("pdf", found.pdf);
}

static void do_ggx(const json *in) { answer_number("density", ggx(vec_in(in, "m"), number(in, "roughness"))); }

static void do_schlick(const json *in) {
    answer_vec("reflected", schlick(vec_in(in, "reflectance"), number(in, "cosine")));
}

static void do_visible_normal(const json *in) {
    double u0 = number(in, "u0"), u1 = number(in, "u1"), alpha = number(in, "roughness");
    answer_vec("m", visible_normal(u0, u1, vec_in(in, "wo"), alpha));
}

static void do_refracted(const json *in) {
    v3 wo = vec_in(in, "wo"), normal = vec_in(in, "normal");
    double behind;
    answer_vec("direction", refracted(wo, normal, number(in, "ratio"), clamp(dot(wo, normal), 0, 1), &behind));
    answer_number("cosine", behind);
}

static void do_fresnel(const json *in) {
    answer_number("share", fresnel(number(in, "ratio"), number(in, "cosine"), number(in, "behind")));
}

static void do_lambertian(const json *in) {
    site s = site_in(in, (material){0});
    answer_scattered(in, &s);
}

static void do_mirror(const json *in) {
    site s = site_in(in, (material){true, MIRROR, 0});
    answer_scattered(in, &s);
}

static void do_conductor(const json *in) {
    site s = site_in(in, (material){true, CONDUCTOR, number(in, "roughness")});
    answer_scattered(in, &s);
}

static void do_conductor_value(const json *in) {
    site s = site_in(in, (material){true, CONDUCTOR, number(in, "roughness")});
    double pdf;
    answer_vec("value", material_value(&s, vec_in(in, "wi"), &pdf));
    answer_number("pdf", pdf);
}

static void do_dielectric(const json *in) {
    site s = site_in(in, (material){true, DIELECTRIC, number(in, "ior")});
    s.outside = number(in, "outside") != 0;
    answer_scattered(in, &s);
}

static void do_mis(const json *in) {
    double pdf = number(in, "pdf"), other = number(in, "other");
    answer_number("balance", mis_weight(pdf, other, 1));
    answer_number("power", mis_weight(pdf, other, 2));
}

/* The lamps of scenes/terrace.json. */
static const part TERRACE_LAMPS[2] = {{.corner = {{0.25, 1.75, 0.25}}, .edge_u = {{0.5, 0, 0}},
                                       .edge_v = {{0, 0, 0.5}}, .color = {{1, 0.75, 0.5}}, .power = 12},
                                      {.corner = {{-1.25, 1, 0.25}}, .edge_u = {{0, 0.5, 0}},
                                       .edge_v = {{0.5, 0, 0.125}}, .color = {{0.25, 0.5, 1}}, .power = 4}};

static void do_lamp(const json *in) {
    part lamp = {.edge_u = vec_in(in, "edge_u"), .edge_v = vec_in(in, "edge_v"), .color = vec_in(in, "color")};
    lamp.power = number(in, "power");
    answer_vec("radiance", light_radiance(&lamp));
}

static void do_light_pdf(const json *in) {
    world w = {.from = {.lights = {get(2, sizeof(part)), 2}, .above = {.given = true}}};
    memcpy(w.from.lights.items, TERRACE_LAMPS, sizeof TERRACE_LAMPS);
    weigh_lights(&w);
    double square = number(in, "square"), cosine = number(in, "cosine");
    answer_number("lamp_0", light_pdf(&w, 0, square, cosine));
    answer_number("lamp_1", light_pdf(&w, 1, square, cosine));
}

static void do_unshadowed(const json *in) {
    parts lamps = {get(2, sizeof(part)), 2};
    memcpy(lamps.items, TERRACE_LAMPS, sizeof TERRACE_LAMPS);
    v3 point = vec_in(in, "point"), normal = vec_in(in, "normal");
    answer_vec("unshadowed", unshadowed(lamps, point, normal, vec_in(in, "reflectance")));
}

static const sky TEST_SKY = {true, {{0.16, 0.3, 0.62}}, {{0.62, 0.7, 0.8}}, {{0.18, 0.16, 0.14}}, {{0.6, 0.8, 0}},
                             {{2.6, 2.2, 1.6}}, 64};

static void do_sky_radiance(const json *in) {
    world w = {.from = {.above = TEST_SKY}, .sun = weigh_sun(&TEST_SKY)};
    v3 d = vec_in(in, "direction");
    answer_vec("radiance", sky_radiance(&w, d));
    answer_number("pdf", sky_pdf(&w, d));
}

static void do_sky_sample(const json *in) {
    world w = {.from = {.above = TEST_SKY}, .sun = weigh_sun(&TEST_SKY)};
    answer_vec("direction", sky_sample(&w, number(in, "u_choice"), number(in, "u0"), number(in, "u1")));
}

/* LTR-5, LTR-6, LTR-8, LTR-9, and the chapter on Sobol points */
static settings read_settings(const json *in) {
    const json *first = field(in, "roulette_depth");
    const char *strategy = text(in, "strategy"), *heuristic = text(in, "heuristic");
    const char *sampler = text(in, "sampler");
    settings made = {.max_depth = (int)whole_of(field(in, "max_depth"), 0, 2147483647.0, "max_depth")};
    made.roulette_depth = first->type == J_NULL ? -1 : (int)whole_of(first, 0, 2147483647.0, "roulette_depth");
    made.strategy = !strcmp(strategy, "mis") ? MIS : !strcmp(strategy, "light") ? BY_LIGHT : BY_BSDF;
    made.exponent = !strcmp(heuristic, "power") ? 2 : 1;
    made.draw = !strcmp(sampler, "sobol") ? sobol_block : random_block;
    if (made.strategy == BY_BSDF && strcmp(strategy, "bsdf")) refuse("%.80s is no strategy", strategy);
    if (made.exponent == 1 && strcmp(heuristic, "balance")) refuse("%.80s is no heuristic", heuristic);
    if (made.draw == random_block && strcmp(sampler, "pcg4d")) refuse("%.80s is no sampler", sampler);
    return made;
}

static world world_in(const json *in) {
    size_t length;
    const char *content = read_file(text(field(in, "scene"), "file"), &length);
    return build(read_scene(content, length), read_settings(field(in, "settings")));
}

static path path_in(const json *in) {
    return (path){vec_in(in, "origin"), vec_in(in, "direction"), vec_in(in, "beta"), vec_in(in, "radiance"),
                  number(in, "pdf")};
}

static uint32_t side(const json *in, const char *name) {
    return (uint32_t)whole_of(field(in, name), 1, 65536, name);
}

static path start_in(const json *in, const world *w) {
    uint32_t x = counter(in, "x"), y = counter(in, "y");
    return start(w, side(in, "width"), side(in, "height"), x, y, counter(in, "seed"), counter(in, "sample"));
}

static void do_start(const json *in) {
    world w = world_in(in);
    path p = start_in(in, &w);
    answer_whole("pixel", pixel_counter(counter(in, "x"), counter(in, "y")));
    answer_vec("origin", p.origin);
    answer_vec("direction", p.direction);
}

static void do_arrive(const json *in) {
    world w = world_in(in);
    path p = path_in(in);
    hit h = arrive(&w, &p);
    answer_vec("radiance", p.radiance);
    answer_vec("point", h.point);
    answer_vec("normal", h.normal);
    answer_vec("reflectance", w.surfaces[h.id].reflectance);
    answer_number("t", h.t);
    answer_whole("surface", (uint32_t)h.id);
}

static void do_scatter(const json *in) {
    world w = world_in(in);
    path p = path_in(in);
    hit h = {number(in, "t"), counter(in, "surface"), vec_in(in, "point"), vec_in(in, "normal")};
    bool alive = scatter(&w, &p, &h, vec_in(in, "reflectance"), counter(in, "depth"), counter(in, "seed"),
                         counter(in, "pixel"), counter(in, "sample"));
    open_output("alive");
    put(&answer, alive ? "true" : "false");
    answer_vec("origin", p.origin);
    answer_vec("direction", p.direction);
    answer_vec("beta", p.beta);
    answer_vec("radiance", p.radiance);
    answer_number("pdf", p.pdf);
}

static void do_shadow(const json *in) {
    world w = world_in(in);
    hit h = {number(in, "t"), counter(in, "surface"), vec_in(in, "point"), vec_in(in, "normal")};
    answer_vec("direct", direct(&w, &h, vec_in(in, "reflectance"), counter(in, "seed"), counter(in, "pixel"),
                                counter(in, "sample"), counter(in, "shadow_rays"), counter(in, "shadow_number")));
}

static void do_whole(const json *in) {
    world w = world_in(in);
    path p = start_in(in, &w);
    uint32_t seed = counter(in, "seed"), sample = counter(in, "sample");
    uint32_t pixel = pixel_counter(counter(in, "x"), counter(in, "y"));
    size_t most = (size_t)(w.how.max_depth < 1000 ? w.how.max_depth : 1000) + 1, count = 0;
    double *t = get(most, sizeof *t);
    uint32_t *ids = get(most, sizeof *ids);
    enum { POINT, ON, SHARE, BETA, LIGHT_SO_FAR, KINDS_OF_VECTORS };
    static const char *const names[] = {"point", "normal", "reflectance", "beta", "radiance"};
    double *found[KINDS_OF_VECTORS];
    for (int i = 0; i < KINDS_OF_VECTORS; i++) found[i] = get(most * 3, sizeof(double));
    for (bool alive = true; alive && count < most; count++) {
        hit h = arrive(&w, &p);
        v3 told[KINDS_OF_VECTORS] = {h.point, h.normal, w.surfaces[h.id].reflectance, p.beta, p.radiance};
        t[count] = h.t;
        ids[count] = (uint32_t)h.id;
        for (int i = 0; i < KINDS_OF_VECTORS; i++) memcpy(found[i] + 3 * count, told[i].c, sizeof told[i].c);
        alive = scatter(&w, &p, &h, w.surfaces[h.id].reflectance, (uint32_t)count, seed, pixel, sample);
    }
    answer_array("t", (array){.axes = 1, .shape = {count}, .count = count, .values = t});
    answer_wholes("surface", ids, count);
    for (int i = 0; i < KINDS_OF_VECTORS; i++)
        answer_array(names[i], (array){.axes = 2, .shape = {count, 3}, .count = 3 * count, .values = found[i]});
}

/* LTR-8: the radiance of one path */
static v3 trace(const world *w, uint32_t width, uint32_t height, uint32_t x, uint32_t y, uint32_t seed,
                uint32_t sample) {
    path p = start(w, width, height, x, y, seed, sample);
    for (int depth = 0;; depth++) {
        hit h = arrive(w, &p);
        if (depth == w->how.max_depth) return p.radiance;
        v3 reflectance = w->surfaces[h.id].reflectance;
        if (!scatter(w, &p, &h, reflectance, (uint32_t)depth, seed, pixel_counter(x, y), sample))
            return p.radiance;
    }
}

/* RND-1, RND-4 */
static void do_rendered(const json *in) {
    world w = world_in(in);
    uint32_t width = side(in, "width"), height = side(in, "height"), seed = counter(in, "seed");
    uint32_t spp = (uint32_t)whole_of(field(in, "spp"), 1, 4294967295.0, "spp");
    uint32_t others = spp > 1 ? spp - 1 : 1; /* one sample differs from nothing: its variance is 0 */
    size_t shape[3] = {height, width, 3};
    array mean = new_array(3, shape), variance = new_array(3, shape);
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++)
            for (uint32_t n = 0; n < spp; n++) {
                v3 color = trace(&w, width, height, x, y, seed, n);
                for (size_t c = 0; c < 3; c++) {
                    size_t at = ((size_t)y * width + x) * 3 + c;
                    double off = color.c[c] - mean.values[at];
                    mean.values[at] += off / (n + 1);
                    variance.values[at] += off * (color.c[c] - mean.values[at]) / others;
                }
            }
    answer_array("mean", mean);
    answer_array("variance", variance);
    answer_whole("spp", spp);
}

static void do_init(const json *in) {
    array given = array_in(in, "widths", 1);
    size_t widths[MOST_LAYERS + 1];
    uint32_t seed = counter(in, "seed");
    if (given.count < 2 || given.count > MOST_LAYERS) refuse("a network has 1 to %d layers", MOST_LAYERS - 1);
    check_omega(number(in, "omega_0_first"));
    check_omega(number(in, "omega_0_hidden"));
    for (size_t l = 0; l < given.count; l++) {
        if (!(given.values[l] >= 1)) refuse("a layer has one neuron at least");
        widths[l] = (size_t)clamp(given.values[l], 0, 1e6);
    }
    network n = new_network(given.count - 1, widths);
    for (size_t l = 0; l < n.layers; l++) {
        double wide = (double)widths[l], bound = l ? sqrt(6 / wide) / number(in, "omega_0_hidden") : 1 / wide;
        for (size_t i = 0; i < widths[l] * widths[l + 1]; i++)
            n.weights[l][i] = initial(seed, l, 0x57454947, i, bound);
        for (size_t i = 0; i < widths[l + 1]; i++)
            n.biases[l][i] = initial(seed, l, 0x42494153, i, 1 / sqrt(wide));
    }
    answer_network(&n, "weight", "bias");
}

static void do_forward(const json *in) {
    network n = read_network(in);
    array x = array_in(in, "x", 1);
    char name[32];
    if (x.count != n.widths[0]) refuse("x does not fit the first layer");
    double *at = x.values;
    for (size_t l = 0; l < n.layers; l++) {
        at = forward_layer(&n, l, at);
        snprintf(name, sizeof name, "layer_%u", (unsigned)l);
        size_t count = n.widths[l + 1];
        answer_array(name, (array){.axes = 1, .shape = {count}, .count = count, .values = at});
    }
}

static void do_gradient(const json *in) {
    network n = read_network(in), sums = new_network(n.layers, n.widths);
    array x = array_in(in, "x", 2), target = array_in(in, "target", 2);
    double loss = 0;
    if (x.shape[1] != n.widths[0] || target.shape[1] != n.widths[n.layers] || x.shape[0] != target.shape[0])
        refuse("x and target do not fit the network");
    for (size_t i = 0; i < x.shape[0]; i++)
        loss += gradient(&n, x.values + i * x.shape[1], target.values + i * target.shape[1], x.shape[0], &sums);
    answer_number("loss", loss);
    answer_network(&sums, "dweight", "dbias");
}

static void do_adam_step(const json *in) {
    double theta = number(in, "theta"), m = number(in, "m"), v = number(in, "v");
    double rate = number(in, "learning_rate");
    adam(&theta, number(in, "g"), &m, &v, rate, number(in, "growth_1"), number(in, "growth_2"));
    answer_number("theta", theta);
    answer_number("m", m);
    answer_number("v", v);
}

static void do_adam_run(const json *in) {
    array theta = array_in(in, "theta", 1), gradients = array_in(in, "gradients", 2), told[3];
    static const char *const names[] = {"theta", "m", "v"};
    size_t n = theta.count, steps = gradients.shape[0];
    if (gradients.shape[1] != n) refuse("gradients do not fit theta");
    double *m = get(n, sizeof *m), *v = get(n, sizeof *v), rate = number(in, "learning_rate");
    for (int i = 0; i < 3; i++) told[i] = new_array(2, gradients.shape);
    for (size_t t = 0; t < steps; t++)
        for (size_t i = 0; i < n; i++) {
            double growth_1 = 1 - pow(0.9, (double)t + 1), growth_2 = 1 - pow(0.999, (double)t + 1);
            adam(&theta.values[i], gradients.values[t * n + i], &m[i], &v[i], rate, growth_1, growth_2);
            told[0].values[t * n + i] = theta.values[i];
            told[1].values[t * n + i] = m[i];
            told[2].values[t * n + i] = v[i];
        }
    for (int i = 0; i < 3; i++) answer_array(names[i], told[i]);
}

static void do_whole_input(const json *in) {
    array x = array_in(in, "x", 1);
    for (size_t i = 0; i < x.count; i++) {
        if (!(fabs(x.values[i]) <= 1)) refuse("a feature is in [-1, 1]");
        x.values[i] = whole_input((float)x.values[i]);
    }
    answer_array("n", x);
}

static void do_whole_sine(const json *in) {
    const polynomial *sine = sine_with(amplitude_in(in));
    array phase = array_in(in, "phase", 1);
    if (!whole_within(phase.values, phase.count, 0, 4294967295.0)) refuse("a phase is a word");
    for (size_t i = 0; i < phase.count; i++) phase.values[i] = whole_sine(sine, (uint32_t)phase.values[i]);
    answer_array("value", phase);
}

static void do_whole_forward(const json *in) {
    whole n = read_whole(in);
    array x = array_in(in, "n", 1);
    char name[32];
    if (x.count != n.of.widths[0]) refuse("n does not fit the first layer");
    if (!whole_within(x.values, x.count, -INPUT_LEVELS, INPUT_LEVELS)) refuse("an input is not in [-127, 127]");
    double *at = x.values;
    for (size_t l = 0; l < n.of.layers; l++) {
        at = whole_layer(&n, l, at);
        snprintf(name, sizeof name, "layer_%u", (unsigned)l);
        array told = {.axes = 1, .shape = {n.of.widths[l + 1]}, .count = n.of.widths[l + 1], .values = at};
        answer_array(is_last(&n, l) ? "color" : name, told);
    }
}

static void answer_rounded(const whole *made) {
    char name[32];
    answer_network(&made->of, "weight", "bias");
    for (size_t l = 0; l < made->of.layers; l++) {
        snprintf(name, sizeof name, "factor_%u", (unsigned)l);
        size_t count = made->of.widths[l + 1];
        answer_array(name, (array){.axes = 1, .shape = {count}, .count = count, .values = made->factors[l]});
    }
    answer_whole("fraction", (uint32_t)made->fraction);
}

static void do_whole_rounded(const json *in) {
    network n = read_network(in);
    size_t size = (size_t)whole_of(field(in, "size"), 1, 64, "the window's size");
    whole made = rounded(&n, size, amplitude_in(in));
    answer_rounded(&made);
}

static void do_whole_rounded_on(const json *in) {
    network n = read_network(in);
    size_t size = (size_t)whole_of(field(in, "size"), 1, 64, "the window's size");
    array windows = array_in(in, "windows", 2);
    if (!windows.count || windows.shape[1] != n.widths[0]) refuse("windows do not fit the first layer");
    for (size_t i = 0; i < windows.count; i++)
        if (!(fabs(windows.values[i]) <= 1)) refuse("a feature is in [-1, 1]");
    whole made = rounded_on(&n, size, amplitude_in(in), &windows);
    answer_rounded(&made);
}

static void do_srgb(const json *in) { answer_number("encoded", srgb_encode(number(in, "linear"))); }

static void do_exposed(const json *in) {
    answer_number("exposed", exposed(number(in, "linear"), number(in, "exposure_stops")));
}

static void do_display(const json *in) { answer_number("encoded", to_display(number(in, "linear"), 0)); }

static void do_shown(const json *in) {
    answer_number("encoded", to_display(number(in, "linear"), number(in, "exposure_stops")));
}

static void do_sine(const json *in) { answer_number("sin", emitted_sine(number(in, "x"))); }

static void do_features(const json *in) {
    features wanted = features_named(text(in, "features"));
    scales s = read_scales(in);
    answer_array("image", feature_image(in, &wanted, &s));
}

static void do_smoothed(const json *in) {
    array color = array_in(in, "color", 3), guides[GUIDE_COUNT];
    check_layer(&color, &color, 3, "color");
    read_guides(in, GUIDES[0], &color, guides);
    answer_array("color", smoothed(color, guides, (unsigned)whole_of(field(in, "levels"), 0, 20, "levels")));
}

static void do_window(const json *in) {
    array image = array_in(in, "image", 3);
    window w = read_window(in);
    uint32_t x = counter(in, "x"), y = counter(in, "y");
    if (x >= image.shape[1] || y >= image.shape[0]) refuse("there is no such pixel");
    size_t count = w.size * w.size * image.shape[2];
    double *taps = get(count, sizeof *taps);
    window_at(&image, w, x, y, taps);
    answer_array("window", (array){.axes = 1, .shape = {count}, .count = count, .values = taps});
}

static void do_draws(const json *in) {
    array shapes = array_in(in, "shapes", 2);
    uint32_t count = (uint32_t)whole_of(field(in, "count"), 0, 1e6, "count"), seed = counter(in, "seed"),
             stream = counter(in, "stream");
    uint32_t *frame = get(count, sizeof *frame), *y = get(count, sizeof *y), *x = get(count, sizeof *x);
    uint64_t total = 0;
    if (shapes.shape[1] != 2 || !shapes.count) refuse("shapes are pairs of a height and a width");
    for (size_t i = 0; i < shapes.count; i++)
        if (!(shapes.values[i] >= 1 && shapes.values[i] <= 65536)) refuse("a side is outside its range");
    for (size_t f = 0; f < shapes.shape[0]; f++)
        total += (uint64_t)shapes.values[2 * f] * (uint64_t)shapes.values[2 * f + 1];
    for (uint32_t i = 0; i < count; i++) {
        uint64_t at = pixel_draw(seed, stream, i, total), size;
        while (at >= (size = (uint64_t)(shapes.values[2 * frame[i]] * shapes.values[2 * frame[i] + 1]))) {
            at -= size;
            frame[i]++;
        }
        uint64_t width = (uint64_t)shapes.values[2 * frame[i] + 1];
        y[i] = (uint32_t)(at / width);
        x[i] = (uint32_t)(at % width);
    }
    answer_wholes("frame", frame, count);
    answer_wholes("y", y, count);
    answer_wholes("x", x, count);
}

static void do_mse(const json *in) {
    array x, r;
    read_pair(in, &x, &r);
    answer_number("value", mean_error(&x, &r, error_mse));
}

/* MET-4, for L = 1 */
static void do_psnr(const json *in) {
    array x, r;
    read_pair(in, &x, &r);
    double mse = mean_error(&x, &r, error_mse);
    answer_number("value", mse == 0 ? HUGE_VAL : 10 * log10(1 / mse));
}

static void do_ssim(const json *in) {
    array x, r;
    read_pair(in, &x, &r);
    answer_number("value", ssim(&x, &r));
}

static void do_blurred(const json *in) {
    array x, r;
    read_pair(in, &x, &r);
    answer_number("value", blurred(&x, &r));
}

static void do_relmse(const json *in) {
    array x, r;
    read_pair(in, &x, &r);
    answer_number("value", mean_error(&x, &r, error_relmse));
}

static void do_smape(const json *in) {
    array x, r;
    read_pair(in, &x, &r);
    answer_number("value", mean_error(&x, &r, error_smape));
}

static const char *parameters_digest(const network *n) {
    size_t total = 0, at = 0;
    for (size_t l = 0; l < n->layers; l++) total += (n->widths[l] + 1) * n->widths[l + 1];
    unsigned char *bytes = get(total, 8);
    for (size_t l = 0; l < n->layers; l++) {
        size_t weights = n->widths[l] * n->widths[l + 1];
        for (size_t i = 0; i < weights + n->widths[l + 1]; i++) {
            double value = i < weights ? n->weights[l][i] : n->biases[l][i - weights];
            uint64_t bits;
            memcpy(&bits, &value, sizeof bits);
            for (int k = 0; k < 8; k++, bits >>= 8) bytes[at++] = (unsigned char)(bits & 0xff);
        }
    }
    return sha256(bytes, at);
}

static void do_model(const json *in) {
    model m = read_model(text(in, "content"));
    uint32_t widths[MOST_LAYERS + 1];
    double omegas[2] = {m.net.omega_first, m.net.omega_hidden};
    buffer names = {0};
    for (size_t l = 0; l <= m.net.layers; l++) widths[l] = (uint32_t)m.net.widths[l];
    for (size_t i = 0; i < m.shown.count; i++) {
        put(&names, i ? "," : "");
        put(&names, FEATURES[m.shown.items[i]]);
    }
    answer_text("digest", parameters_digest(&m.net));
    answer_wholes("widths", widths, m.net.layers + 1);
    answer_text("features", names.text);
    answer_whole("window", (uint32_t)m.win.size);
    answer_text("border", m.win.zeros ? "zero" : "clamp");
    answer_array("omega_0", (array){.axes = 1, .shape = {2}, .count = 2, .values = omegas});
}

static void do_camera_text(const json *in) {
    const json *from = field(in, "text");
    camera read = read_camera(parse(text_of(from, "text"), from->length));
    answer_vec("position", read.position);
    answer_vec("look_at", read.look_at);
    answer_vec("up", read.up);
    answer_number("vertical_fov_deg", read.fov);
}

static void do_scene(const json *in) {
    const json *content = field(in, "text");
    if (content->type != J_TEXT) refuse("a scene is a text");
    scene s = read_scene(content->text, content->length);
    answer_text("digest", scene_digest(&s));
}

/* DEN-3 */
static void do_denoised(const json *in) {
    model m = read_model(text(in, "model"));
    array image = feature_image(in, &m.shown, &m.how);
    size_t shape[3] = {image.shape[0], image.shape[1], 3};
    array picture = new_array(3, shape);
    for (size_t y = 0; y < shape[0]; y++)
        for (size_t x = 0; x < shape[1]; x++)
            denoise_pixel(&m, &image, x, y, picture.values + 3 * (y * shape[1] + x));
    answer_array("picture", picture);
}

/* ---- protocol: CNF-8, CNF-9 ----------------------------------------------------------------------------- */

static void do_sky_share(const json *in) {
    sky s = {.given = true, .sun_direction = UP};
    s.zenith = vec_in(in, "zenith");
    s.horizon = vec_in(in, "horizon");
    s.ground = vec_in(in, "ground");
    s.sun_irradiance = vec_in(in, "sun_irradiance");
    answer_number("share", weigh_sun(&s).share);
}

static const struct {
    const char *name;
    void (*answer)(const json *in);
} KINDS[] = {
    {"random.pcg4d", do_pcg4d},
    {"random.float", do_float},
    {"random.block", do_random_block},
    {"random.scrambled", do_scrambled},
    {"random.point", do_point},
    {"random.sobol", do_sobol},
    {"sampling.concentric_disk", do_disk},
    {"sampling.cosine_hemisphere", do_hemisphere},
    {"sampling.spherical_cauchy", do_cauchy},
    {"sampling.quad", do_quad},
    {"sampling.discrete", do_discrete},
    {"sampling.tangent_frame", do_tangents},
    {"sampling.to_world", do_to_world},
    {"camera.axes", do_axes},
    {"camera.ray", do_camera},
    {"intersection.slabs", do_slabs},
    {"intersection.sphere", do_sphere},
    {"intersection.quad", do_plane},
    {"intersection.box", do_box},
    {"intersection.turned_box", do_turned_box},
    {"intersection.room", do_room},
    {"intersection.nearest", do_nearest},
    {"intersection.occluded", do_occluded},
    {"material.ggx", do_ggx},
    {"material.schlick", do_schlick},
    {"material.visible_normal", do_visible_normal},
    {"material.refracted", do_refracted},
    {"material.fresnel", do_fresnel},
    {"material.lambertian", do_lambertian},
    {"material.mirror", do_mirror},
    {"material.conductor", do_conductor},
    {"material.conductor_value", do_conductor_value},
    {"material.dielectric", do_dielectric},
    {"transport.lamp", do_lamp},
    {"transport.light_pdf", do_light_pdf},
    {"transport.mis_weight", do_mis},
    {"transport.unshadowed", do_unshadowed},
    {"sky.radiance", do_sky_radiance},
    {"sky.sample", do_sky_sample},
    {"path.start", do_start},
    {"path.arrive", do_arrive},
    {"path.scatter", do_scatter},
    {"path.shadow", do_shadow},
    {"path.whole", do_whole},
    {"picture.rendered", do_rendered},
    {"picture.exact", do_rendered},
    {"vector", do_vector},
    {"network.init", do_init},
    {"network.forward", do_forward},
    {"network.gradient", do_gradient},
    {"adam.step", do_adam_step},
    {"adam.run", do_adam_run},
    {"whole.input", do_whole_input},
    {"whole.sine", do_whole_sine},
    {"whole.forward", do_whole_forward},
    {"whole.rounded", do_whole_rounded},
    {"whole.rounded_on", do_whole_rounded_on},
    {"encoding.srgb", do_srgb},
    {"encoding.exposed", do_exposed},
    {"encoding.display", do_display},
    {"encoding.shown", do_shown},
    {"sine", do_sine},
    {"image.features", do_features},
    {"image.smoothed", do_smoothed},
    {"image.window", do_window},
    {"image.draws", do_draws},
    {"metric.mse", do_mse},
    {"metric.psnr", do_psnr},
    {"metric.ssim", do_ssim},
    {"metric.relmse", do_relmse},
    {"metric.smape", do_smape},
    {"metric.blurred", do_blurred},
    {"file.model", do_model},
    {"file.camera", do_camera_text},
    {"file.scene", do_scene},
    {"picture.denoised", do_denoised},
    {"sky.share", do_sky_share},
};

static void answer_hello(void) {
    put(&answer, "{\"program\": \"wamnet.c 1.0\", \"kinds\": [");
    for (size_t i = 0; i < sizeof KINDS / sizeof *KINDS; i++) {
        if (i) put(&answer, ", ");
        put_json_text(&answer, KINDS[i].name, strlen(KINDS[i].name));
    }
    put(&answer, "]}");
}

static void answer_request(const json *request, const char *kind) {
    for (size_t i = 0; i < sizeof KINDS / sizeof *KINDS; i++)
        if (!strcmp(kind, KINDS[i].name)) {
            put(&answer, ", \"output\": {");
            KINDS[i].answer(field(request, "input"));
            put(&answer, "}}");
            return;
        }
    put(&answer, ", \"unsupported\": \"this kind is not known\"}");
}

/* Answer a line. What is refused has no output; what is no request at all has the id null. */
static void serve(const char *line, size_t length) {
    static size_t head; /* the answer's length up to its id; static: longjmp leaves it alone */
    head = 0;
    answer = (buffer){0};
    if (!setjmp(way_out)) {
        const json *request = parse(line, length);
        const char *kind = text(request, "kind");
        if (!strcmp(kind, "hello")) {
            answer_hello();
        } else {
            const json *id = field(request, "id");
            put(&answer, "{\"id\": ");
            put_json_text(&answer, text_of(id, "id"), id->length);
            head = answer.length;
            answer_request(request, kind);
        }
    } else {
        if (head) fwrite(answer.text, 1, head, stdout);
        else fputs("{\"id\": null", stdout);
        fputs(", \"refused\": \"", stdout);
        for (const char *c = reason; *c; c++)
            if ((unsigned char)*c >= 0x20 && (unsigned char)*c < 0x7f && *c != '"' && *c != '\\') putchar(*c);
        fputs("\"}", stdout);
        answer.length = 0;
    }
    if (answer.length) fwrite(answer.text, 1, answer.length, stdout);
    putchar('\n');
    fflush(stdout);
    free_all();
}

/* Return the next line without its end, in memory that the next call uses again, or nothing. */
static char *read_line(size_t *length) {
    static char *line;
    static size_t size;
    int c;
    *length = 0;
    while ((c = getchar()) != EOF && c != '\n') {
        if (*length == size) {
            char *longer = realloc(line, size = 2 * size + 4096);
            if (!longer) exit(EXIT_FAILURE);
            line = longer;
        }
        line[(*length)++] = (char)c;
    }
    if (c == EOF && !*length) {
        free(line);
        line = NULL;
        return NULL;
    }
    return line;
}

int main(void) {
    size_t length;
    for (char *line; (line = read_line(&length));)
        if (length) serve(line, length);
    return 0;
}
