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
    "is left. Tasks may run at once, one after the other or again, on one machine or on many.\n"
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

static int run(int argc, char **argv)
{
    static const struct option options[] = {{"task", required_argument, NULL, TASK},
                                            {"threads", required_argument, NULL, THREADS},
                                            {0}};
    const char *threads = NULL;
    struct tetlod_error error = {0};
    struct plan plan;
    struct work_share share = {0};
    uint64_t members = 1;
    for (int option; (option = cli_option(&command_run, argc, argv, "", options)) != -1;) {
        if (option == TASK ? !parse_task(optarg, &members) : option != THREADS)
            return EXIT_USAGE;
        threads = option == THREADS ? optarg : threads;
    }
    if (!cli_operands(&command_run, argc, 1, "the FOLDER of a plan"))
        return EXIT_USAGE;
    int result = EXIT_DONE;
    if (plan_open(&plan, argv[optind], &error) != TETLOD_OK ||
        folder_share_new(&share, plan.folder, (uint32_t)members, &error) != TETLOD_OK) {
        result = cli_fail(&error);
    } else {
        plan_add_option(&plan, "--threads", threads);
        optind = 0;
        result = build_together(plan.count, plan.arguments, &share);
    }
    folder_share_free(&share);
    plan_close(&plan);
    return result;
}

const struct command command_run = {"run", "do one task's share of a plan", help, run};
