// SPDX-License-Identifier: Apache-2.0
export function textOf(json) {
  return JSON.stringify(json, null, 1);
}
