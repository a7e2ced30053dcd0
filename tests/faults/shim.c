/* Counts the calls of a program that read, write or change files below a directory, and lets one of them fail. Preloaded by
 * LD_PRELOAD. FAULTS_DIRECTORY names the directory; FAULTS_CONTROL a file of at least sizeof(struct control) bytes, which the test
 * and the program map into their memory. So the test begins and ends to count at any moment, and reads what happened.
 *
 * Cannot see what a program writes into mapped memory, such as SQLite's index of its write-ahead log (-shm), nor calls that do not
 * go through the C library.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/uio.h>
#include <unistd.h>

enum { CALLS = 1 << 16 };

/* The kinds of faults, as `KINDS` in disk.py. */
enum kind {
    NONE,
    EIO_ONCE,  /* The n-th call fails. */
    EIO_ON,    /* All calls from the n-th on fail. */
    FULL,      /* All calls from the n-th on that need space fail. */
    SHORT,     /* The n-th call reads or writes half. */
    KILL,      /* The program is killed before the n-th call. */
    TORN,      /* The program is killed after half of the n-th write, or after another call. */
};

struct control {
    uint32_t armed, at, kind, count, hits;
    /* The first call that met the fault: its letter and its file. */
    char met[236];
    /* The letter of each call. */
    char calls[CALLS];
};

static struct control *control;
static const char *directory;
static size_t length;

__attribute__((constructor)) static void begin(void) {
    const char *name = getenv("FAULTS_CONTROL");
    directory = getenv("FAULTS_DIRECTORY");
    if (!name || !directory) return;
    length = strlen(directory);
    int file = open(name, O_RDWR | O_CLOEXEC);
    if (file < 0) abort();
    void *map = mmap(NULL, sizeof *control, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (map == MAP_FAILED) abort();
    close(file);
    control = map;
}

/* Does the next function of this name in the C library. */
#define NEXT(type, name) ((type)dlsym(RTLD_NEXT, name))

static int is_below(const char *path) {
    return strncmp(path, directory, length) == 0 && path[length] == '/';
}

/* What happens to a call on a path: w(rite), r(ead), t(runcate), s(ync), n(ame), u(nlink). */
static enum kind meets(char call, const char *path) {
    if (!control || !control->armed || !is_below(path)) return NONE;
    uint32_t number = __atomic_add_fetch(&control->count, 1, __ATOMIC_SEQ_CST);
    if (number < CALLS) control->calls[number] = call;
    enum kind kind = control->kind;
    int is_met = kind == EIO_ON || kind == FULL ? number >= control->at : number == control->at;
    if (kind == FULL) is_met = is_met && strchr("wtsn", call);
    if (kind == SHORT) is_met = is_met && strchr("wr", call);
    if (!is_met || kind == NONE) return NONE;
    if (__atomic_add_fetch(&control->hits, 1, __ATOMIC_SEQ_CST) == 1)
        snprintf(control->met, sizeof control->met, "%c %s", call, path + length + 1);
    if (kind == KILL) {
        kill(getpid(), SIGKILL);
        pause();
    }
    return kind;
}

static enum kind meets_file(char call, int file) {
    if (!control || !control->armed) return NONE;
    char link[64], path[4096];
    int before = errno;
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    ssize_t size = readlink(link, path, sizeof path - 1);
    errno = before;
    if (size < 0) return NONE;
    path[size] = 0;
    return meets(call, path);
}

/* Does the call as its fate says: `part` does a half, and `whole` all of it. */
#define FAULTY(fate, part, whole) \
    do { \
        enum kind met = (fate); \
        if (met == EIO_ONCE || met == EIO_ON) return errno = EIO, -1; \
        if (met == FULL) return errno = ENOSPC, -1; \
        if (met == SHORT) return part; \
        if (met == TORN) { \
            ssize_t done = (part); \
            (void)done; \
            kill(getpid(), SIGKILL); \
            pause(); \
        } \
        return whole; \
    } while (0)

/* Half of a size, but not nothing, which would mean the end of the file. */
static size_t half(size_t size) { return (size + 1) / 2; }

#define TRANSFER(name, letter, pointer) \
    ssize_t name(int file, pointer data, size_t size) { \
        ssize_t (*next)(int, pointer, size_t) = NEXT(ssize_t (*)(int, pointer, size_t), #name); \
        FAULTY(meets_file(letter, file), next(file, data, half(size)), next(file, data, size)); \
    }
#define TRANSFER_AT(name, letter, pointer, offset) \
    ssize_t name(int file, pointer data, size_t size, offset at) { \
        ssize_t (*next)(int, pointer, size_t, offset) = NEXT(ssize_t (*)(int, pointer, size_t, offset), #name); \
        FAULTY(meets_file(letter, file), next(file, data, half(size), at), next(file, data, size, at)); \
    }
/* Of several parts, a half is the first part. */
#define VECTOR(name, letter) \
    ssize_t name(int file, const struct iovec *parts, int count) { \
        ssize_t (*next)(int, const struct iovec *, int) = NEXT(ssize_t (*)(int, const struct iovec *, int), #name); \
        FAULTY(meets_file(letter, file), next(file, parts, 1), next(file, parts, count)); \
    }
#define VECTOR_AT(name, letter, offset) \
    ssize_t name(int file, const struct iovec *parts, int count, offset at) { \
        ssize_t (*next)(int, const struct iovec *, int, offset) = NEXT(ssize_t (*)(int, const struct iovec *, int, offset), #name); \
        FAULTY(meets_file(letter, file), next(file, parts, 1, at), next(file, parts, count, at)); \
    }

TRANSFER(write, 'w', const void *)
TRANSFER(read, 'r', void *)
TRANSFER_AT(pwrite, 'w', const void *, off_t)
TRANSFER_AT(pwrite64, 'w', const void *, off64_t)
TRANSFER_AT(pread, 'r', void *, off_t)
TRANSFER_AT(pread64, 'r', void *, off64_t)
VECTOR(writev, 'w')
VECTOR(readv, 'r')
VECTOR_AT(pwritev, 'w', off_t)
VECTOR_AT(pwritev64, 'w', off64_t)
VECTOR_AT(preadv, 'r', off_t)
VECTOR_AT(preadv64, 'r', off64_t)

/* A call that is done or not, for which half means all. */
#define WHOLE(name, letter, offset) \
    int name(int file, offset size) { \
        int (*next)(int, offset) = NEXT(int (*)(int, offset), #name); \
        FAULTY(meets_file(letter, file), next(file, size), next(file, size)); \
    }
WHOLE(ftruncate, 't', off_t)
WHOLE(ftruncate64, 't', off64_t)

#define SYNC(name) \
    int name(int file) { \
        int (*next)(int) = NEXT(int (*)(int), #name); \
        FAULTY(meets_file('s', file), next(file), next(file)); \
    }
SYNC(fsync)
SYNC(fdatasync)

int rename(const char *from, const char *to) {
    int (*next)(const char *, const char *) = NEXT(int (*)(const char *, const char *), "rename");
    FAULTY(meets('n', to), next(from, to), next(from, to));
}

int linkat(int old, const char *from, int new, const char *to, int flags) {
    int (*next)(int, const char *, int, const char *, int) = NEXT(int (*)(int, const char *, int, const char *, int), "linkat");
    FAULTY(meets('n', to), next(old, from, new, to, flags), next(old, from, new, to, flags));
}

int unlink(const char *path) {
    int (*next)(const char *) = NEXT(int (*)(const char *), "unlink");
    FAULTY(meets('u', path), next(path), next(path));
}
