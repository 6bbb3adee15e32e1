// Header and bytes of the page as typed arrays; the layout is that of payload.py.
const readHeader = () => JSON.parse(document.getElementById("header").textContent);

async function unpack() {
  const element = document.getElementById("payload"), stream = new Blob([fromBase64(element.textContent.trim())]).stream();
  element.remove();
  return new Uint8Array(await new Response(stream.pipeThrough(new DecompressionStream("gzip"))).arrayBuffer());
}

function fromBase64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const binary = atob(text), bytes = new Uint8Array(binary.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

// Plane by plane: the first bytes of all values, then the second ones.
function join16(bytes, Type) {
  const count = bytes.length / 2, joined = new Type(count);
  for (let i = 0; i < count; i++) joined[i] = bytes[i] | (bytes[count + i] << 8);
  return joined;
}

// With three planes the lowest byte is zero.
function join32(bytes, planes) {
  const count = bytes.length / planes, joined = new Uint32Array(count);
  for (let plane = 0; plane < planes; plane++) {
    const start = plane * count, shift = 8 * (plane + 4 - planes);
    for (let i = 0; i < count; i++) joined[i] |= bytes[start + i] << shift;
  }
  return joined;
}

// Twice: what is stored are changes of changes.
function sumOverKeys(values, perKey) {
  for (let time = 0; time < 2; time++) {
    for (let i = perKey; i < values.length; i++) values[i] += values[i - perKey];
  }
  return values;
}

function packRotations(largest, parts) {
  const packed = new Uint32Array(largest.length);
  for (let i = 0, j = 0; i < packed.length; i++, j += 3) {
    packed[i] = (largest[i] << 30) | parts[j] | (parts[j + 1] << 10) | (parts[j + 2] << 20);
  }
  return packed;
}

function decodeScene(header, bytes) {
  const sections = {};
  let start = 0;
  for (const [name, length] of header.sections) {
    sections[name] = bytes.subarray(start, start + length);
    start += length;
  }
  if (bytes.length !== start) throw new Error("the file is damaged or incomplete");
  const scene = {
    means: new Float32Array(join32(sections.means, 3).buffer),
    logScales: join16(sections.log_scales, Int16Array),
    quats: join32(sections.quats, 4),
    colors: sections.colors,
    opacities: sections.opacities,
    harmonics: sections.harmonics,
  };
  if (!header.moving) return scene;
  const perKey = header.moving * 3;
  scene.offsets = sumOverKeys(join16(sections.offsets, Int16Array), perKey);
  const parts = sumOverKeys(join16(sections.rotation_components, Uint16Array), perKey);
  scene.rotations = packRotations(sections.rotation_largest, parts);
  scene.logScaleOffsets = sumOverKeys(join16(sections.log_scale_offsets, Int16Array), perKey);
  return scene;
}
