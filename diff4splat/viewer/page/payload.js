// Header and bytes of the page as typed arrays; the layout is that of payload.py.
async function readPayload() {
  const header = JSON.parse(document.getElementById("header").textContent);
  const element = document.getElementById("payload");
  const packed = await (await fetch("data:application/octet-stream;base64," + element.textContent.trim())).blob();
  element.remove();
  const stream = packed.stream().pipeThrough(new DecompressionStream("gzip"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const sections = {};
  let start = 0;
  for (const [name, length] of header.sections) {
    sections[name] = bytes.subarray(start, start + length);
    start += length;
  }
  return { header, sections };
}

// Plane by plane: the first bytes of all values, then the second ones.
function joinPlanes(bytes, size, Type, skip = 0) {
  const count = bytes.length / (size - skip), raw = new Uint8Array(count * size);
  for (let plane = skip; plane < size; plane++) {
    const offset = (plane - skip) * count;
    for (let i = 0; i < count; i++) raw[i * size + plane] = bytes[offset + i];
  }
  return new Type(raw.buffer);
}

// Twice: what is stored are changes of changes.
function sumOverKeys(values, perKey) {
  for (let time = 0; time < 2; time++) {
    for (let i = perKey; i < values.length; i++) values[i] += values[i - perKey];
  }
  return values;
}

function packRotations(largest, parts) {
  return Uint32Array.from(largest, (which, i) => (which << 30) | parts[3 * i] | (parts[3 * i + 1] << 10) | (parts[3 * i + 2] << 20));
}

function decodeScene({ header, sections }) {
  const scene = {
    means: joinPlanes(sections.means, 4, Float32Array, 1),
    logScales: joinPlanes(sections.log_scales, 2, Int16Array),
    quats: joinPlanes(sections.quats, 4, Uint32Array),
    colors: sections.colors,
    opacities: sections.opacities,
    harmonics: sections.harmonics,
  };
  if (!header.moving) return scene;
  const perKey = header.moving * 3;
  scene.offsets = sumOverKeys(joinPlanes(sections.offsets, 2, Int16Array), perKey);
  const parts = sumOverKeys(joinPlanes(sections.rotation_components, 2, Uint16Array), perKey);
  scene.rotations = packRotations(sections.rotation_largest, parts);
  scene.logScaleOffsets = sumOverKeys(joinPlanes(sections.log_scale_offsets, 2, Int16Array), perKey);
  return scene;
}
