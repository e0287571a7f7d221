/* A disk that refuses, for LD_PRELOAD: every call that would change a file below FAULTS_ROOT is counted, over all
 * processes, in the mapped file FAULTS_CONTROL, and from number `first` to number `last` it fails with `error`.
 * tests/torture/disk.py writes the same struct. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

struct control {
  int armed, count, first, last, error, failed;
};

static struct control *control;
static char root[PATH_MAX];

__attribute__((constructor)) static void set_up(void) {
  const char *path = getenv("FAULTS_CONTROL"), *below = getenv("FAULTS_ROOT");
  if (!path || !below) return;
  int fd = open(path, O_RDWR | O_CLOEXEC);
  if (fd < 0) return;
  void *map = mmap(NULL, sizeof *control, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
  close(fd);
  if (map == MAP_FAILED) return;
  snprintf(root, sizeof root, "%s", below);
  control = map;
}

static int refused(void) {
  int number = __atomic_add_fetch(&control->count, 1, __ATOMIC_SEQ_CST);
  if (number < control->first || number > control->last) return 0;
  __atomic_add_fetch(&control->failed, 1, __ATOMIC_SEQ_CST);
  errno = control->error;
  return 1;
}

static int refused_path(const char *path) {
  return control && control->armed && path && !strncmp(path, root, strlen(root)) && refused();
}

static int refused_file(int fd) {
  if (!control || !control->armed) return 0;
  char link[64], path[PATH_MAX];
  snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
  ssize_t length = readlink(link, path, sizeof path - 1);
  if (length < 0) return 0;
  path[length] = 0;
  return refused_path(path);
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

ssize_t write(int fd, const void *bytes, size_t size) { return refused_file(fd) ? -1 : REAL(write)(fd, bytes, size); }
ssize_t writev(int fd, const struct iovec *parts, int count) { return refused_file(fd) ? -1 : REAL(writev)(fd, parts, count); }
ssize_t pwrite(int fd, const void *bytes, size_t size, off_t at) { return refused_file(fd) ? -1 : REAL(pwrite)(fd, bytes, size, at); }
ssize_t pwrite64(int fd, const void *bytes, size_t size, off64_t at) { return refused_file(fd) ? -1 : REAL(pwrite64)(fd, bytes, size, at); }
int fsync(int fd) { return refused_file(fd) ? -1 : REAL(fsync)(fd); }
int fdatasync(int fd) { return refused_file(fd) ? -1 : REAL(fdatasync)(fd); }
int ftruncate(int fd, off_t size) { return refused_file(fd) ? -1 : REAL(ftruncate)(fd, size); }
int ftruncate64(int fd, off64_t size) { return refused_file(fd) ? -1 : REAL(ftruncate64)(fd, size); }
int rename(const char *from, const char *to) { return refused_path(to) ? -1 : REAL(rename)(from, to); }
int link(const char *from, const char *to) { return refused_path(to) ? -1 : REAL(link)(from, to); }
int mkdir(const char *path, mode_t mode) { return refused_path(path) ? -1 : REAL(mkdir)(path, mode); }

#define OPEN(name)                                                   \
  int name(const char *path, int flags, ...) {                       \
    mode_t mode = 0;                                                 \
    if (flags & O_CREAT) {                                           \
      va_list rest;                                                  \
      va_start(rest, flags);                                         \
      mode = va_arg(rest, mode_t);                                   \
      va_end(rest);                                                  \
    }                                                                \
    if ((flags & O_CREAT) && refused_path(path)) return -1;          \
    return REAL(name)(path, flags, mode);                            \
  }
OPEN(open)
OPEN(open64)
