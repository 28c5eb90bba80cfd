/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* SCHED_FIFO, pseudo-terminals, prctl: only the host's files ask for more than C99 */
#include "host_board.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sched.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>
#ifdef __linux__
#include <sys/prctl.h>
#endif

#include "../../haptic_board.h"

enum { PRIORITY = 84, LINE = 256 };

static const int64_t SECOND = 1000000000;

static struct host_clock clock_options;
static int64_t began; /* CLOCK_MONOTONIC [ns] */

static int port = -1, other_side = -1; /* file descriptors; other_side: of a pseudo-terminal, kept open */
static bool datagrams, torn;           /* torn: the line took a part of the last frame only */
static char link_path[512];
static struct sockaddr_in sender, peer;

static bool input_open = true;
static char input[LINE];
static int input_held;

static volatile sig_atomic_t ending;
static sigset_t while_waiting;

/* ---- time ---- */

int64_t host_monotonic_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * SECOND + now.tv_nsec;
}

static int64_t shift(int64_t monotonic) {
    double stepped = (double)(monotonic - began) * 1e-9 >= clock_options.step_at ? clock_options.step * 1e3 : 0.0;
    return (int64_t)(clock_options.offset * 1e9 + stepped);
}

int64_t host_device_time(int64_t monotonic) {
    return monotonic + shift(monotonic) + (int64_t)((double)(monotonic - began) * clock_options.ppm * 1e-6);
}

int64_t host_monotonic_time(int64_t device) {
    double rate = clock_options.ppm * 1e-6;
    int64_t since = device - shift(host_monotonic_ns()) - began;
    return began + since - (int64_t)((double)since * rate / (1.0 + rate));
}

int64_t board_now_ns(void) {
    return host_device_time(host_monotonic_ns());
}

/* ---- the process ---- */

static void end(int number) {
    (void)number;
    ending = 1;
}

void host_begin(const struct host_clock *options) {
    static const int ENDING[3] = {SIGINT, SIGTERM, SIGHUP};
    struct sigaction action;
    sigset_t blocked;
    if (fcntl(STDIN_FILENO, F_GETFD) < 0) { /* else the line would become the standard input */
        (void)!open("/dev/null", O_RDONLY);
    }
    clock_options = *options;
    began = host_monotonic_ns();
    memset(&action, 0, sizeof action);
    action.sa_handler = end;
    sigemptyset(&blocked);
    for (int i = 0; i < 3; i++) {
        sigaction(ENDING[i], &action, NULL);
        sigaddset(&blocked, ENDING[i]);
    }
    sigprocmask(SIG_BLOCK, &blocked, &while_waiting); /* they come in host_wait_until, and nowhere between */
    for (int i = 0; i < 3; i++) {
        sigdelset(&while_waiting, ENDING[i]);
    }
}

void host_prefer_realtime(void) {
    struct sched_param priority;
    memset(&priority, 0, sizeof priority);
    priority.sched_priority = PRIORITY;
    sched_setscheduler(0, SCHED_FIFO, &priority);
    mlockall(MCL_CURRENT | MCL_FUTURE);
#ifdef __linux__
    prctl(PR_SET_TIMERSLACK, 1);
#endif
}

void host_end_with_parent(void) {
#ifdef __linux__
    pid_t parent = getppid();
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() != parent) { /* it ended before the request stood */
        ending = 1;
    }
#endif
}

bool host_ending(void) {
    struct timespec none = {0, 0};
    pselect(0, NULL, NULL, NULL, &none, &while_waiting);
    return ending;
}

/* ---- the line ---- */

int host_open_udp(const char *address, int number) {
    socklen_t size = sizeof sender;
    memset(&sender, 0, sizeof sender);
    sender.sin_family = AF_INET;
    sender.sin_port = htons((uint16_t)number);
    if (inet_pton(AF_INET, address, &sender.sin_addr) != 1) {
        errno = EINVAL;
        return -1;
    }
    datagrams = true;
    port = socket(AF_INET, SOCK_DGRAM, 0);
    if (port < 0 || bind(port, (struct sockaddr *)&sender, size) < 0 ||
        getsockname(port, (struct sockaddr *)&sender, &size) < 0 || fcntl(port, F_SETFL, O_NONBLOCK) < 0) {
        return -1;
    }
    return ntohs(sender.sin_port);
}

static int linked(const char *name, const char *link) {
    struct stat there;
    if (strlen(link) >= sizeof link_path) {
        errno = ENAMETOOLONG;
        return -1;
    }
    if (lstat(link, &there) == 0) { /* a link that an earlier run has left is replaced, nothing else */
        if (!S_ISLNK(there.st_mode)) {
            errno = EEXIST;
            return -1;
        }
        unlink(link);
    }
    if (symlink(name, link) < 0) {
        return -1;
    }
    strcpy(link_path, link);
    return 0;
}

const char *host_open_pty(const char *link) {
    struct termios line;
    const char *name;
    port = posix_openpt(O_RDWR | O_NOCTTY);
    if (port < 0 || grantpt(port) < 0 || unlockpt(port) < 0 || (name = ptsname(port)) == NULL) {
        return NULL;
    }
    other_side = open(name, O_RDWR | O_NOCTTY); /* kept open: a host that leaves must not end the line */
    if (other_side < 0 || tcgetattr(other_side, &line) < 0) {
        return NULL;
    }
    line.c_iflag = line.c_oflag = line.c_lflag = 0; /* bytes as they are */
    line.c_cflag = CS8 | CREAD | CLOCAL;
    line.c_cc[VMIN] = 1;
    line.c_cc[VTIME] = 0;
    if (tcsetattr(other_side, TCSANOW, &line) < 0 || fcntl(port, F_SETFL, O_NONBLOCK) < 0 || linked(name, link) < 0) {
        return NULL;
    }
    return name;
}

int board_read(uint8_t *bytes, int room) {
    socklen_t size = sizeof sender;
    ssize_t count = datagrams ? recvfrom(port, bytes, (size_t)room, 0, (struct sockaddr *)&sender, &size)
                              : read(port, bytes, (size_t)room);
    return count > 0 ? (int)count : 0;
}

void board_answer_sender(void) {
    peer = sender;
}

void board_write(const uint8_t *bytes, int count) {
    if (datagrams) {
        if (peer.sin_port != 0) {
            (void)!sendto(port, bytes, (size_t)count, 0, (struct sockaddr *)&peer, sizeof peer);
        }
        return;
    }
    if (torn) { /* what is left of that frame must not join this one */
        if (write(port, "", 1) != 1) {
            return;
        }
        torn = false;
    }
    ssize_t written = write(port, bytes, (size_t)count);
    torn = written > 0 && written < count;
}

void host_wait_until(int64_t time) {
    int64_t left = host_monotonic_time(time) - host_monotonic_ns();
    struct timespec wait = {0, 0};
    fd_set files;
    FD_ZERO(&files);
    FD_SET(port, &files);
    if (input_open) {
        FD_SET(STDIN_FILENO, &files);
    }
    if (left > 0) {
        wait.tv_sec = left / SECOND;
        wait.tv_nsec = left % SECOND;
    }
    pselect((port > STDIN_FILENO ? port : STDIN_FILENO) + 1, &files, NULL, NULL, &wait, &while_waiting);
}

/* ---- the standard input ---- */

static bool cut_line(char *line, int room) {
    char *stop = memchr(input, '\n', (size_t)input_held);
    if (stop == NULL) {
        return false;
    }
    int length = (int)(stop - input), copied = length < room - 1 ? length : room - 1;
    memcpy(line, input, (size_t)copied);
    line[copied] = 0;
    input_held -= length + 1;
    memmove(input, stop + 1, (size_t)input_held);
    return true;
}

static bool has_come(void) {
    struct timespec none = {0, 0};
    fd_set files;
    FD_ZERO(&files);
    FD_SET(STDIN_FILENO, &files);
    return pselect(STDIN_FILENO + 1, &files, NULL, NULL, &none, NULL) == 1;
}

bool host_line(char *line, int room) {
    if (cut_line(line, room)) {
        return true;
    }
    if (!input_open || !has_come()) {
        return false;
    }
    if (input_held == LINE) { /* a line without an end */
        input_held = 0;
    }
    ssize_t count = read(STDIN_FILENO, input + input_held, (size_t)(LINE - input_held));
    input_open = count > 0 || (count < 0 && errno == EINTR);
    input_held += count > 0 ? (int)count : 0;
    return cut_line(line, room);
}

void host_close(void) {
    if (link_path[0] != 0) {
        unlink(link_path);
    }
    if (other_side >= 0) {
        close(other_side);
    }
    close(port);
}
