/* SPDX-License-Identifier: BSD-3-Clause */
#define _GNU_SOURCE // mkostemp
#include "src/util/temporary.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdlib.h>
#include <unistd.h>

struct temporary {
    const char *name;
    pthread_t thread;
    sigset_t signals, before;
};

/* Those that would end the process: also where a handler is there for once, which has something to say before. */
static void choose_signals(sigset_t *out)
{
    static const int numbers[] = {SIGINT, SIGTERM, SIGHUP};
    sigemptyset(out);
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        struct sigaction action;
        if (sigaction(numbers[i], NULL, &action) == 0 &&
            (action.sa_handler == SIG_DFL || (unsigned)action.sa_flags & (unsigned)SA_RESETHAND))
            sigaddset(out, numbers[i]);
    }
}

static void *wait_for_signal(void *argument)
{
    const struct temporary *temporary = argument;
    int number;
    if (sigwait(&temporary->signals, &number) != 0)
        return NULL;
    unlink(temporary->name);
    pthread_sigmask(SIG_UNBLOCK, &temporary->signals, NULL);
    raise(number);
    return NULL;
}

int temporary_open(struct temporary **out, char *name)
{
    struct temporary *temporary = malloc(sizeof *temporary);
    *out = NULL;
    if (temporary) {
        temporary->name = name;
        choose_signals(&temporary->signals);
        pthread_sigmask(SIG_BLOCK, &temporary->signals, &temporary->before);
    }
    int file = mkostemp(name, O_CLOEXEC), failed = errno;
    if (temporary && file >= 0 && pthread_create(&temporary->thread, NULL, wait_for_signal, temporary) == 0) {
        *out = temporary;
    } else if (temporary) {
        pthread_sigmask(SIG_SETMASK, &temporary->before, NULL);
        free(temporary);
    }
    errno = failed;
    return file;
}

void temporary_end(struct temporary *temporary)
{
    if (!temporary)
        return;
    pthread_cancel(temporary->thread); // sigwait is where it can be
    pthread_join(temporary->thread, NULL);
    pthread_sigmask(SIG_SETMASK, &temporary->before, NULL);
    free(temporary);
}
