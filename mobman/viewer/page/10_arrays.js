// Arrays that Python packed as base64.
const KINDS = { f8: Float64Array, f4: Float32Array, u1: Uint8Array, u2: Uint16Array, u4: Uint32Array };

function unpack(packed) {
  if (!packed) return null;
  const text = atob(packed.data);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  const values = new KINDS[packed.kind](bytes.buffer);
  values.columns = packed.shape.length > 1 ? packed.shape[1] : 1;
  values.rows = packed.shape[0];
  return values;
}

// Placements are written row by row; three.js takes them as arguments in that order.
function matrixOf(rows) {
  return new THREE.Matrix4().set(...rows);
}

// A rigid placement as rows of numbers, for whoever asks from outside.
function rowsOf(matrix) {
  const e = matrix.elements;
  return [0, 1, 2, 3].map((row) => [0, 1, 2, 3].map((column) => e[4 * column + row]));
}
