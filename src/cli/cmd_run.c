/* SPDX-License-Identifier: BSD-3-Clause */
#include <string.h>

#include "src/cli/cli.h"
#include "src/cli/plan.h"
#include "src/many/folder_share.h"
#include "src/util/number_text.h"

static const char help[] =
    "usage: tetlod run FOLDER [--task I/N] [--threads N]\n"
    "\n"
    "One task of what tetlod plan has written down: it does work that no other task has begun, until none\n"
    "is left. Tasks may run at once, one after the other or again, on one machine or on many. The first\n"
    "one reads the mesh; others read the cells that it leaves in FOLDER.\n"
    "\n"
    "      --task I/N   task I of N: how much of the measuring it takes at once (default: 1/1)\n"
    "      --threads N  threads (default: as many as there are cores)\n"
    "\n"
    "example: tetlod run work --task $SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT\n";

enum { TASK = 256, THREADS };

/* 3/8 */
static bool parse_task(const char *text, uint64_t *members)
{
    char first[24];
    const char *slash = strchr(text, '/');
    uint64_t task;
    if (slash && (size_t)(slash - text) < sizeof first) {
        snprintf(first, sizeof first, "%.*s", (int)(slash - text), text);
        if (text_count(first, false, &task) && text_count(slash + 1, false, members) && *members >= 1 &&
            task <= *members && *members <= 1000000)
            return true;
    }
    cli_usage("run", "--task takes I/N, task I of N, not '%s'", text);
    return false;
}

/* Leads, or helps. True: the leader has died, and somebody has to lead. */
static bool take_part(struct plan *plan, uint32_t members, int *out)
{
    struct tetlod_error error = {0};
    struct work_share share;
    enum tetlod_status status = folder_share_new(&share, plan->folder, members, false, &error);
    bool over = status == TETLOD_OK && folder_share_is_over(&share);
    *out = EXIT_DONE;
    optind = 0;
    if (status == TETLOD_OK && !over)
        *out = build_together(plan->count, plan->arguments, &share);
    bool again = status == TETLOD_OK && *out == EXIT_DONE && folder_share_is_orphaned(&share);
    if (status == TETLOD_OK && *out == EXIT_DONE && !over)
        status = folder_share_finish(&share, &error);
    if (status != TETLOD_OK)
        *out = cli_fail(&error);
    folder_share_free(&share);
    return again;
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {{"task", required_argument, NULL, TASK},
                                            {"threads", required_argument, NULL, THREADS},
                                            {0}};
    const char *threads = NULL;
    struct tetlod_error error = {0};
    struct plan plan;
    uint64_t members = 1;
    for (int option; (option = cli_option(&command_run, argc, argv, "", options)) != -1;) {
        if (option == TASK ? !parse_task(optarg, &members) : option != THREADS)
            return EXIT_USAGE;
        threads = option == THREADS ? optarg : threads;
    }
    if (!cli_operands(&command_run, argc, 1, "the FOLDER of a plan"))
        return EXIT_USAGE;
    int result = EXIT_DONE;
    if (plan_open(&plan, argv[optind], &error) != TETLOD_OK) {
        result = cli_fail(&error);
    } else {
        plan_add_option(&plan, "--threads", threads);
        while (take_part(&plan, (uint32_t)members, &result))
            ;
    }
    plan_close(&plan);
    return result;
}

const struct command command_run = {"run", "do one task's share of a plan", help, run};
