// SPDX-License-Identifier: BSD-3-Clause
// What the tests of the web client share: TAP lines, and waiting.

const { ONLY = '' } = process.env; // a part of the names of those to run, for one file at a time

/** Runs functions in turn, each a test by its name; one may return the reason why it was skipped. `mend()` is for what
 * the others share, when one has failed. */
export async function run(all, mend = () => {}) {
  const tests = all.filter(({ name }) => name.includes(ONLY));
  let failed = 0;
  if (!tests.length) {
    console.log(`not ok 1 - a test has '${ONLY}' in its name`);
    failed = 1;
  }
  for (const [number, test] of tests.entries()) {
    const line = `${number + 1} - ${test.name}`;
    const began = performance.now();
    try {
      const skipped = await test();
      console.log(`ok ${line}${typeof skipped === 'string' ? ` # SKIP ${skipped}` : ''}`);
    } catch (error) {
      failed++;
      console.log(`not ok ${line}`);
      console.log(String(error?.stack ?? error).replace(/^/gm, '# '));
      await mend();
    }
    console.log(`# ${((performance.now() - began) / 1000).toFixed(1)} s`);
  }
  console.log(`1..${tests.length}`);
  process.exit(failed ? 1 : 0); // whatever still listens
}
