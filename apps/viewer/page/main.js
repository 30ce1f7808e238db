// SPDX-License-Identifier: Apache-2.0
import { textOf } from './text.js';

const runs = await (await fetch('/api/runs')).json();
document.getElementById('runs').textContent = textOf(runs);
