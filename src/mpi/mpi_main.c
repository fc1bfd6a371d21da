/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * tetlod-mpi: tetlod build by the ranks of an MPI job. Rank 0 says what is to be said: what the others would say they
 * keep, and of a failure it goes to rank 0.
 */
#define _GNU_SOURCE // memfd_create
#include <mpi.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "src/cli/build_request.h"
#include "src/cli/cli.h"
#include "src/mpi/mpi_share.h"
#include "src/util/number_text.h"
#include "src/util/parallel.h"

static const char help[] =
    "usage: mpirun -n RANKS tetlod-mpi build INPUT... [-o OUT.tetlod] [OPTIONS of tetlod build]\n"
    "\n"
    "Builds the stream that tetlod build --paged INPUT would, byte for byte, with the ranks of an MPI job:\n"
    "they share out the pieces of INPUT that are read (PVTU, OpenFOAM, Exodus), or ranges of it (one VTU or\n"
    "VTKHDF), the cells that are contracted, the samples that errors are measured at, and the pages that are\n"
    "coded. Rank 0 joins and writes. No rank has the mesh in memory: one takes half more than its share, and two\n"
    "cells; the rest is in temporary files.\n"
    "\n"
    "      --memory BYTES  how much memory each rank may take instead: with more, fewer files\n"
    "      --scratch DIR   the folder of these files on each machine (default: TMPDIR, else /tmp)\n"
    "      --threads N     threads of each rank (default: the cores of its machine, by its ranks)\n"
    "      --model N       say at the end what the job has cost, and what it would on N ranks\n"
    "\n"
    "All other options: 'tetlod help build'. Without MPI: 'tetlod help plan'. --version says which one it is.\n"
    "\n"
    "example: mpirun -n 16 tetlod-mpi build case.pvtu -o case.tetlod\n";

/* Messages of a rank that does not speak are kept in memory: there may be no folder for a file. */
static bool keep_messages(void)
{
    int fd = memfd_create("messages", MFD_CLOEXEC);
    bool done = fd >= 0 && dup2(fd, STDERR_FILENO) >= 0;
    if (fd >= 0)
        close(fd);
    return done;
}

/* What this rank has kept, in a block that the caller frees; NULL: nothing. */
static char *kept_messages(void)
{
    off_t size = fflush(stderr) == 0 ? lseek(STDERR_FILENO, 0, SEEK_END) : 0;
    char *text = size > 0 ? calloc((size_t)size + 1, 1) : NULL;
    if (text && pread(STDERR_FILENO, text, (size_t)size, 0) != size)
        text[0] = 0;
    return text;
}

/* Where ranks share cores each is to have its core for a tenth of a second, not for some milliseconds: after each it
 * would bring its cell into the caches again. Before Linux 6.12 the system takes no notice. */
static void ask_for_slices(void)
{
#ifdef SYS_sched_setattr
    const struct {
        uint32_t size, policy;
        uint64_t flags;
        int32_t nice;
        uint32_t priority;
        uint64_t slice, deadline, period;
    } attributes = {.size = sizeof attributes, .nice = getpriority(PRIO_PROCESS, 0), .slice = 100000000};
    if (sched_getscheduler(0) == SCHED_OTHER)
        syscall(SYS_sched_setattr, 0, &attributes, 0);
#endif
}

/* Threads of a rank: the machine's cores by its ranks, and no more than the rank may use. */
static unsigned own_threads(void)
{
    MPI_Comm machine;
    int ranks = 1;
    long cores = sysconf(_SC_NPROCESSORS_ONLN);
    MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &machine);
    MPI_Comm_size(machine, &ranks);
    MPI_Comm_free(&machine);
    if (ranks > cores)
        ask_for_slices();
    unsigned own = cores > ranks ? (unsigned)(cores / ranks) : 1, allowed = parallel_cores();
    return own < allowed ? own : allowed;
}

/* Takes --model N out of the arguments. False: N is no number of ranks. */
static bool take_model(int *io_argc, char **argv, uint64_t *out)
{
    int kept = 0;
    bool good = true;
    for (int i = 0; i < *io_argc; i++) {
        bool alone = strcmp(argv[i], "--model") == 0, joined = strncmp(argv[i], "--model=", 8) == 0;
        const char *text = joined ? argv[i] + 8 : alone && i + 1 < *io_argc ? argv[i + 1] : "";
        if (alone || joined)
            good &= text_count(text, false, out) && *out >= 1 && *out <= 1000000;
        else
            argv[kept++] = argv[i];
        i += alone;
    }
    *io_argc = kept;
    return good;
}

/* The arguments of tetlod build, with threads before the user's own. */
static int build(int argc, char **argv, const struct work_share *share)
{
    char threads[32];
    char **arguments = calloc((size_t)argc + 2, sizeof *arguments);
    snprintf(threads, sizeof threads, "--threads=%u", own_threads());
    if (!arguments)
        return EXIT_FAILED;
    arguments[0] = argv[1];
    arguments[1] = threads;
    for (int i = 2; i < argc; i++)
        arguments[i] = argv[i];
    cli_give_memory_back();
    int result = build_together(argc, arguments, share);
    free(arguments);
    return result;
}

/* What a job costs on so many ranks: of the rank that takes longest, then of all. Of one rank alone it is not known how
 * much others would be sent. */
static void print_row(const struct job_cost *cost, uint32_t ranks, uint32_t n)
{
    printf("%-12u %10.2f %10.2f %10.2f", n, job_cost_of(cost, n), job_cost_of(cost, 1) / job_cost_of(cost, n),
           job_cost_of_all(cost, n));
    if (ranks > 1)
        printf(" %10.1f", job_cost_moved(cost, n) / 1e6);
    printf("\n");
}

/* What the job has cost, and what it would on other numbers of ranks: processor seconds of the rank that takes longest,
 * which with a core for each thread and a fast network is the time that the job takes. */
static void print_cost(const struct job_cost *cost, uint32_t ranks, uint32_t asked)
{
    printf("%-12s %6s %10s %10s %10s\n", "stage", "parts", "work s", "longest s", "each s");
    for (uint32_t i = 0; i < cost->stage_count; i++)
        printf("%-12u %6u %10.3f %10.3f %10.3f\n", i + 1, cost->stages[i].parts, cost->stages[i].work,
               cost->stages[i].longest, cost->stages[i].alone);
    printf("%-12s %6s %10s %10s %10.3f\n", "each rank", "", "", "", cost->alone);
    printf("%-12s %6s %10s %10s %10.3f\n", "rank 0", "", "", "", cost->leads);
    printf("%-12s %6s %10s %10s %10.3f\n\n", "meanwhile", "", "", "", cost->meanwhile);
    printf("%-12s %10s %10s %10s%s\n", "ranks", "seconds", "speed-up", "s in all", ranks > 1 ? "   MB moved" : "");
    for (uint32_t n = 1; n < asked; n *= 2)
        print_row(cost, ranks, n);
    print_row(cost, ranks, asked);
    printf("\non %u ranks: %.0f MB of memory on rank 0, at most %.0f MB on others\n", ranks,
           (double)cost->resident[0] / 1e6, (double)cost->resident[1] / 1e6);
    printf("%.2f s of processor time in all, %.2f s on the rank that took most\n", cost->spent[1], cost->spent[0]);
    printf("%.1f MB moved in all, %.1f MB to the rank that received most\n", (double)cost->moved[1] / 1e6,
           (double)cost->moved[0] / 1e6);
}

/* Collective. */
static int model(const struct work_share *share, uint32_t asked, int rank)
{
    struct tetlod_error error = {0};
    struct job_cost cost;
    if (mpi_share_cost(share, &cost, &error) != TETLOD_OK)
        return cli_fail(&error);
    if (rank == 0)
        print_cost(&cost, share->members, asked);
    job_cost_fini(&cost);
    return EXIT_DONE;
}

/* Every rank ends as the first that has failed. */
static int finish(struct work_share *share, int result, int rank)
{
    char *own = rank ? kept_messages() : NULL, *text = NULL;
    int failed = 0;
    bool good = mpi_share_finish(share, result == EXIT_DONE, own ? own : "", &failed, &text);
    if (!good && rank == 0 && failed && text)
        fprintf(stderr, "tetlod-mpi: rank %d: %s", failed, text);
    if (!good)
        MPI_Bcast(&result, 1, MPI_INT, failed, MPI_COMM_WORLD);
    free(own);
    free(text);
    return result;
}

/* Anything but a build. */
static int say_usage(const char *word, int rank)
{
    const bool helps = cli_asks_help(word), version = strcmp(word, "--version") == 0;
    if (rank == 0 && version)
        printf("tetlod-mpi " TETLOD_VERSION_STRING "\n");
    else if (rank == 0)
        fputs(help, helps ? stdout : stderr);
    return helps || version ? EXIT_DONE : EXIT_USAGE;
}

static int run(int argc, char **argv, int rank)
{
    struct tetlod_error error = {0};
    struct work_share share;
    uint64_t asked = 0;
    if (argc < 3 || strcmp(argv[1], "build") != 0)
        return say_usage(argc > 1 ? argv[1] : "", rank);
    if (!take_model(&argc, argv, &asked)) {
        if (rank == 0)
            fprintf(stderr, "tetlod-mpi: --model takes a number of ranks, 1 to 1000000\n");
        return EXIT_USAGE;
    }
    if (mpi_share_new(&share, MPI_COMM_WORLD, &error) != TETLOD_OK)
        return cli_fail(&error);
    int result = finish(&share, build(argc, argv, &share), rank);
    if (result == EXIT_DONE && asked)
        result = model(&share, (uint32_t)asked, rank);
    mpi_share_free(&share);
    return result;
}

/* Where a rank dies mpirun ends the others: rank 0 says so, and then ends as it would. */
static void on_end(int number)
{
    static const char text[] = "tetlod-mpi: a rank has died, or the job was told to stop: there is no stream; the same "
                               "command begins anew\n";
    ssize_t written = write(STDERR_FILENO, text, sizeof text - 1);
    (void)written;
    raise(number);
}

int main(int argc, char **argv)
{
    int rank, provided;
    // Open MPI: ranks that wait sleep between looks; one that gave way to all others would last as long as they run
    setenv("OMPI_MCA_mpi_yield_when_idle", "0", 0);
    MPI_Init_thread(&argc, &argv, MPI_THREAD_SERIALIZED, &provided);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    if (provided < MPI_THREAD_SERIALIZED) {
        if (rank == 0)
            fprintf(stderr, "tetlod-mpi: this MPI has no MPI_THREAD_SERIALIZED, which it needs\n");
        MPI_Abort(MPI_COMM_WORLD, EXIT_FAILED);
    }
    if (rank && !keep_messages())
        fprintf(stderr, "tetlod-mpi: rank %d: has no memory for messages, and says them by itself\n", rank);
    if (rank == 0)
        sigaction(SIGTERM, &(struct sigaction){.sa_handler = on_end, .sa_flags = (int)SA_RESETHAND}, NULL);
    int result = run(argc, argv, rank);
    signal(SIGTERM, SIG_DFL); // what there is to say is said: mpirun may end the others as soon as one has failed
    MPI_Finalize();
    return result;
}
