// SPDX-License-Identifier: Apache-2.0
// Preloaded into gflow (LD_PRELOAD): the k-th call that changes, or reads, a file under one folder
// fails. The path of a descriptor is read from /proc.
//   FAULT_FOLDER  only paths under it count (must contain no symbolic link)
//   FAULT_CALL    k, from 1; 0: no call fails
//   FAULT_LAST    the last call that fails (default: k; a large number: the disk stays full)
//   FAULT_ROOM    1: calls succeed again once a file is removed that is not a temporary
//   FAULT_ERRNO   value of errno
//   FAULT_KILL    a signal that the k-th call raises instead of failing; the call is made once the program
//                 continues (SIGSTOP, SIGCONT). Removals count as well
//   FAULT_REPORT  file that gets a line per call: its number, "failed", "made" or "parted", its name, the path
//   FAULT_PARTS   1: write, read, sendfile and copy_file_range process half of the bytes
//   FAULT_READS   1: counts calls that read instead of calls that change
//   FAULT_WHO     processes that count: "first", the started program without its children, or a program's
//                 name; default: all, each counting for itself
// Calls that change: open to write, write, pwrite, writev, fwrite, fopen to write, fclose, close after an
// open to write, fsync, rename, ftruncate, truncate, posix_fallocate, sendfile and copy_file_range (which
// copy files), link, mkdir. fwrite is included because the C library's internal calls of write cannot be
// intercepted. Calls that read: open and fopen to read, read, pread, readv, fread, mmap of a file open to
// read; not fgets, getc and fscanf. Opening a file that is being written (.part) to flush it does not count.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/sendfile.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

static atomic_long calls;
static atomic_int removed;
static char folder[PATH_MAX];
static long first, last;
static int code, report = -1, reads, room, parts, kills;

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static long number(const char *name, long otherwise) {
  const char *text = getenv(name);
  return text ? atol(text) : otherwise;
}

__attribute__((constructor)) static void start(void) {
  const char *wanted = getenv("FAULT_FOLDER"), *to = getenv("FAULT_REPORT");
  const char *who = getenv("FAULT_WHO");
  if (!wanted || !to) return;
  if (who && !strcmp(who, "first"))
    unsetenv("LD_PRELOAD");
  else if (who && strcmp(who, program_invocation_short_name))
    return;
  snprintf(folder, sizeof folder, "%s", wanted);
  first = number("FAULT_CALL", 0);
  last = number("FAULT_LAST", first);
  code = (int)number("FAULT_ERRNO", ENOSPC);
  reads = (int)number("FAULT_READS", 0);
  room = (int)number("FAULT_ROOM", 0);
  parts = (int)number("FAULT_PARTS", 0);
  kills = (int)number("FAULT_KILL", 0);
  report = NEXT(open)(to, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
}

static void say(long n, const char *outcome, const char *what, const char *path) {
  char line[PATH_MAX + 64];
  const int length = snprintf(line, sizeof line, "%ld %s %s %s\n", n, outcome, what, path);
  if (report >= 0 && NEXT(write)(report, line, (size_t)length) < 0) return;
}

// Whether this call must fail; sets errno if so.
static int counts(const char *what, const char *path) {
  const size_t length = strlen(folder);
  if (!length || !path || strncmp(path, folder, length) != 0 ||
      (path[length] != '/' && path[length] != '\0'))
    return 0;
  const long n = atomic_fetch_add(&calls, 1) + 1;
  const int failed = first > 0 && n >= first && n <= last && !(room && removed), before = errno;
  say(n, failed ? "failed" : "made", what, path);
  if (failed && kills) kill(getpid(), kills);
  errno = failed && !kills ? code : before;
  return failed && !kills;
}

static int strikes(const char *what, const char *path) { return !reads && counts(what, path); }
static int strikes_reading(const char *what, const char *path) {
  struct stat facts;
  const int before = errno, regular = reads && path && !stat(path, &facts) &&
                                      S_ISREG(facts.st_mode) && !strstr(path, ".part");
  errno = before;
  return regular && counts(what, path);
}

// The path of a descriptor that is open to write (or of any, for fsync); NULL if it has none.
static const char *path_of(int fd, int any, char *path) {
  char link[64];
  const int before = errno;
  snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
  const int mode = fcntl(fd, F_GETFL);
  const ssize_t length = readlink(link, path, PATH_MAX - 1);
  errno = before;
  if (mode < 0 || length < 0 || (!any && (mode & O_ACCMODE) == O_RDONLY)) return NULL;
  path[length] = '\0';
  return path;
}

static int strikes_at(const char *what, int fd, int any) {
  char path[PATH_MAX];
  return *folder && strikes(what, path_of(fd, any, path));
}
static int strikes_reading_of(const char *what, int fd) {
  char path[PATH_MAX];
  return reads && *folder && strikes_reading(what, path_of(fd, 1, path));
}

// How many of `count` bytes a call writes or reads.
static size_t part_of(const char *what, int fd, size_t count) {
  char path[PATH_MAX];
  const size_t length = strlen(folder);
  if (!parts || !length || count < 2 || !path_of(fd, 1, path) || strncmp(path, folder, length) != 0)
    return count;
  say(0, "parted", what, path);
  return count / 2;
}

static int opened(const char *name, const char *path, int flags, mode_t mode) {
  if ((flags & O_ACCMODE) != O_RDONLY && strikes("open", path)) return -1;
  if ((flags & O_ACCMODE) == O_RDONLY && strikes_reading("open", path)) return -1;
  return ((int (*)(const char *, int, ...))dlsym(RTLD_NEXT, name))(path, flags, mode);
}
#define OPEN(name)                                                  \
  int name(const char *path, int flags, ...) {                      \
    va_list more;                                                   \
    va_start(more, flags);                                          \
    const mode_t mode = flags & O_CREAT ? va_arg(more, mode_t) : 0; \
    va_end(more);                                                   \
    return opened(#name, path, flags, mode);                        \
  }
OPEN(open)
OPEN(open64)

static FILE *file_opened(const char *name, const char *path, const char *mode) {
  if (strpbrk(mode, "wa+") && strikes("fopen", path)) return NULL;
  if (!strpbrk(mode, "wa+") && strikes_reading("fopen", path)) return NULL;
  return ((FILE * (*)(const char *, const char *)) dlsym(RTLD_NEXT, name))(path, mode);
}
FILE *fopen(const char *path, const char *mode) { return file_opened("fopen", path, mode); }
FILE *fopen64(const char *path, const char *mode) { return file_opened("fopen64", path, mode); }

size_t fwrite(const void *bytes, size_t size, size_t count, FILE *file) {
  if (file != stdout && file != stderr && strikes_at("fwrite", fileno(file), 0)) {
    file->_flags |= 0x20;  // the error flag of ferror() in the GNU C library
    return 0;
  }
  return NEXT(fwrite)(bytes, size, count, file);
}
int fclose(FILE *file) {
  const int failed = strikes_at("fclose", fileno(file), 0), why = errno;
  const int result = NEXT(fclose)(file);
  if (!failed) return result;
  errno = why;
  return EOF;
}
ssize_t write(int fd, const void *bytes, size_t count) {
  if (strikes_at("write", fd, 0)) return -1;
  return NEXT(write)(fd, bytes, part_of("write", fd, count));
}
ssize_t pwrite(int fd, const void *bytes, size_t count, off_t at) {
  return strikes_at("pwrite", fd, 0) ? -1 : NEXT(pwrite)(fd, bytes, count, at);
}
ssize_t writev(int fd, const struct iovec *parts, int count) {
  return strikes_at("writev", fd, 0) ? -1 : NEXT(writev)(fd, parts, count);
}
int close(int fd) {
  const int failed = strikes_at("close", fd, 0), why = errno;
  const int result = NEXT(close)(fd);  // closed even if the call fails, as in the kernel
  if (!failed) return result;
  errno = why;
  return -1;
}
int fsync(int fd) { return strikes_at("fsync", fd, 1) ? -1 : NEXT(fsync)(fd); }
int ftruncate(int fd, off_t size) {
  return strikes_at("ftruncate", fd, 0) ? -1 : NEXT(ftruncate)(fd, size);
}
int truncate(const char *path, off_t size) {
  return strikes("truncate", path) ? -1 : NEXT(truncate)(path, size);
}
int posix_fallocate(int fd, off_t at, off_t size) {
  return strikes_at("posix_fallocate", fd, 0) ? errno : NEXT(posix_fallocate)(fd, at, size);
}
ssize_t sendfile(int to, int from, off_t *at, size_t count) {
  if (strikes_at("sendfile", to, 0)) return -1;
  return NEXT(sendfile)(to, from, at, part_of("sendfile", to, count));
}
ssize_t copy_file_range(int from, off64_t *at, int to, off64_t *there, size_t count, unsigned how) {
  return strikes_at("copy_file_range", to, 0)
             ? -1
             : NEXT(copy_file_range)(from, at, to, there, part_of("copy_file_range", to, count), how);
}
int link(const char *from, const char *to) {
  return strikes("link", to) ? -1 : NEXT(link)(from, to);
}
int rename(const char *from, const char *to) {
  return strikes("rename", to) ? -1 : NEXT(rename)(from, to);
}
static int gone(const char *path, int result) {
  const size_t length = strlen(folder);
  if (result == 0 && length && !strncmp(path, folder, length) && !strstr(path, ".part")) removed = 1;
  return result;
}
int unlink(const char *path) {
  if (kills) strikes("unlink", path);
  return gone(path, NEXT(unlink)(path));
}
int remove(const char *path) {
  if (kills) strikes("remove", path);
  return gone(path, NEXT(remove)(path));
}
int unlinkat(int fd, const char *name, int flags) {
  char path[2 * PATH_MAX] = "";
  if (kills && *folder && *name != '/' && fd != AT_FDCWD && path_of(fd, 1, path))
    snprintf(path + strlen(path), PATH_MAX, "/%s", name);
  if (kills) strikes("unlink", *path ? path : name);
  return NEXT(unlinkat)(fd, name, flags);
}
int mkdir(const char *path, mode_t mode) {
  return strikes("mkdir", path) ? -1 : NEXT(mkdir)(path, mode);
}

size_t fread(void *bytes, size_t size, size_t count, FILE *file) {
  if (strikes_reading_of("fread", fileno(file))) {
    file->_flags |= 0x20;
    return 0;
  }
  return NEXT(fread)(bytes, size, count, file);
}
size_t __fread_chk(void *bytes, size_t room, size_t size, size_t count, FILE *file) {
  return size && room / size < count ? (abort(), 0) : fread(bytes, size, count, file);
}
ssize_t read(int fd, void *bytes, size_t count) {
  if (strikes_reading_of("read", fd)) return -1;
  return NEXT(read)(fd, bytes, part_of("read", fd, count));
}
ssize_t __read_chk(int fd, void *bytes, size_t count, size_t room) {
  return room < count ? (abort(), -1) : read(fd, bytes, count);
}
ssize_t pread(int fd, void *bytes, size_t count, off_t at) {
  return strikes_reading_of("pread", fd) ? -1 : NEXT(pread)(fd, bytes, count, at);
}
ssize_t pread64(int fd, void *bytes, size_t count, off64_t at) {
  return strikes_reading_of("pread", fd) ? -1 : NEXT(pread64)(fd, bytes, count, at);
}
ssize_t readv(int fd, const struct iovec *parts, int count) {
  return strikes_reading_of("readv", fd) ? -1 : NEXT(readv)(fd, parts, count);
}
void *mmap(void *to, size_t size, int protection, int flags, int fd, off_t at) {
  if (fd >= 0 && strikes_reading_of("mmap", fd)) return MAP_FAILED;
  return NEXT(mmap)(to, size, protection, flags, fd, at);
}
void *mmap64(void *to, size_t size, int protection, int flags, int fd, off64_t at) {
  if (fd >= 0 && strikes_reading_of("mmap", fd)) return MAP_FAILED;
  return NEXT(mmap64)(to, size, protection, flags, fd, at);
}
