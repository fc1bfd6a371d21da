// SPDX-License-Identifier: BSD-3-Clause
// The web client chooses levels by the table of tests/choices, as the library and the Python decoder do.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { run } from './tap.mjs';

const root = process.env.ROOT ?? '.';
const { chooseLevel } = await import(pathToFileURL(join(root, 'server/web/client/choose.js')));
const table = JSON.parse(readFileSync(join(root, 'tests/choices/choices.json')));

function levels_are_chosen_as_the_library_does() {
  assert(table.questions.length > 20);
  for (const { level, abs_error: absError, ...target } of table.questions)
    assert.equal(chooseLevel(table, absError === undefined ? target : { ...target, absError }), level,
      JSON.stringify({ absError, ...target }));
}

function a_measure_that_is_not_there_is_an_error() {
  assert.throws(() => chooseLevel(table, { error: 1, field: 'carried' }), RangeError);
  assert.throws(() => chooseLevel(table, { absError: 1, measure: 'predicted' }), RangeError);
}

await run([levels_are_chosen_as_the_library_does, a_measure_that_is_not_there_is_an_error]);
