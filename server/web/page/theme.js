// SPDX-License-Identifier: BSD-3-Clause
// Light or dark: as the system has it until somebody says otherwise.

const key = 'tetlod-theme';
const system = matchMedia('(prefers-color-scheme: dark)');
const stored = () => {
  try {
    return localStorage.getItem(key);
  } catch {
    return null; // storage may be forbidden
  }
};
let chosen = stored();

export const themes = new EventTarget(); // 'change'
export const isDark = () => (chosen ?? (system.matches ? 'dark' : 'light')) === 'dark';

function apply() {
  document.documentElement.dataset.theme = isDark() ? 'dark' : 'light';
  themes.dispatchEvent(new Event('change'));
}

export function switchTheme() {
  chosen = isDark() ? 'light' : 'dark';
  try {
    localStorage.setItem(key, chosen);
  } catch {
    // it holds for this page only
  }
  apply();
}

system.addEventListener('change', apply);
apply();
