/* SPDX-License-Identifier: BSD-3-Clause */
/* Limits of control groups, from a tree like that of the system. */
#define _GNU_SOURCE
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include "src/util/memory_limit.h"
#include "tests/test.h"

static char root[64];

static void put(const char *path, const char *text)
{
    char full[256];
    snprintf(full, sizeof full, "%s%s", root, path);
    for (char *slash = strchr(full + strlen(root) + 1, '/'); slash; slash = strchr(slash + 1, '/')) {
        *slash = 0;
        mkdir(full, 0700);
        *slash = '/';
    }
    FILE *file = fopen(full, "w");
    if (!file || fputs(text, file) < 0 || fclose(file) != 0)
        TEST_FAIL("cannot write %s", full);
}

static void test_limits(void)
{
    strcpy(root, "/tmp/tetlod-limit-XXXXXX");
    REQUIRE(mkdtemp(root));
    uint64_t machine = memory_limit(root);
    CHECK(machine > 1 << 20); // there are no groups
    put("/proc/self/cgroup", "0::/a/b\n");
    CHECK_INT(memory_limit(root), machine);
    put("/sys/fs/cgroup/a/b/memory.max", "max\n");
    CHECK_INT(memory_limit(root), machine);
    put("/sys/fs/cgroup/a/memory.max", "3000000\n");
    CHECK_INT(memory_limit(root), 3000000);
    put("/sys/fs/cgroup/a/b/memory.max", "5000000\n");
    CHECK_INT(memory_limit(root), 3000000);
    put("/sys/fs/cgroup/memory.max", "2000000\n"); // the top of a container's
    CHECK_INT(memory_limit(root), 2000000);
    put("/proc/self/cgroup", "5:cpu:/x\n3:hugetlb,memory:/c\n0::/none\n");
    put("/sys/fs/cgroup/memory/c/memory.limit_in_bytes", "1000000\n");
    CHECK_INT(memory_limit(root), 1000000);
    put("/sys/fs/cgroup/memory/c/memory.limit_in_bytes", "9223372036854771712\n"); // none, in version 1
    CHECK_INT(memory_limit(root), 2000000);
    char command[128];
    snprintf(command, sizeof command, "rm -r %s", root);
    CHECK_INT(system(command), 0);
}

int main(void)
{
    RUN(test_limits);
    return test_end();
}
