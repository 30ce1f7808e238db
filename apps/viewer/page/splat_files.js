import { FileError } from './container.js';
export async function readSplatFiles() { throw new FileError('Not yet.'); }
