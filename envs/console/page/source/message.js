// Messages of haustra.envs.console.wire: a JSON header, then arrays as they lie in memory.
const TYPES = { float32: Float32Array, int32: Int32Array, uint8: Uint8Array };

export function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const arrays = {};
  for (const [name, kind, shape, offset] of header.arrays) {
    const size = shape.reduce((a, b) => a * b, 1);
    arrays[name] = new TYPES[kind](buffer, 4 + length + offset, size);
  }
  return { ...header, arrays };
}

export function fromBase64(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return unpack(bytes.buffer);
}
