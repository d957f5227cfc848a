"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
const png = (coded) => "data:image/png;base64," + coded;
const state = { mesh: 0, view: "smooth" };

// A picture over another one, divided where the slider stands.
function divide(stage, slider, top, edge) {
  const show = () => {
    top.style.clipPath = `inset(0 0 0 ${slider.value}%)`;
    edge.style.left = `${slider.value}%`;
  };
  slider.addEventListener("input", show);
  const follow = (event) => {
    const box = stage.getBoundingClientRect();
    slider.value = Math.round(100 * (event.clientX - box.left) / box.width);
    show();
  };
  stage.addEventListener("pointerdown", (event) => {
    stage.setPointerCapture(event.pointerId);
    follow(event);
  });
  stage.addEventListener("pointermove", (event) => { if (event.buttons) follow(event); });
  show();
}

// Buttons of which one is chosen, by click or arrow keys.
function choice(bar, entries, chosen, choose) {
  const buttons = entries.map(([key, text]) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = text;
    button.dataset.key = key;
    button.setAttribute("role", "radio");
    button.addEventListener("click", () => choose(key));
    bar.append(button);
    return button;
  });
  bar.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    const at = buttons.indexOf(document.activeElement);
    const next = buttons[(at + step + buttons.length) % buttons.length];
    next.focus();
    next.click();
  });
  return () => buttons.forEach((button) => {
    const is = button.dataset.key === String(chosen());
    button.setAttribute("aria-checked", is);
    button.tabIndex = is ? 0 : -1;
  });
}

const updates = [
  choice(byId("meshes"), data.meshes.map((m, k) => [k, m.name]), () => state.mesh,
    (key) => { state.mesh = Number(key); update(); }),
  choice(byId("views"), data.views, () => state.view,
    (key) => { state.view = key; update(); }),
];
let before = "smooth";
function toggleHeat() {
  if (state.view === "heat") {
    state.view = before;
  } else {
    before = state.view;
    state.view = "heat";
  }
  update();
}
byId("heat").addEventListener("change", toggleHeat);
document.addEventListener("keydown", (event) => {
  const writes = event.ctrlKey || event.metaKey || event.altKey;
  if (event.key.toLowerCase() === "h" && !writes && !byId("crop").open) toggleHeat();
});
divide(byId("stage"), byId("slider"), byId("other"), byId("edge"));
divide(byId("crop-stage"), byId("crop-slider"), byId("crop-mesh"), byId("crop-edge"));

function showCrop(mesh, crop) {
  byId("crop-text").textContent = crop.text;
  byId("crop-exact").src = png(crop.exact);
  byId("crop-mesh").src = png(crop.mesh);
  byId("crop").showModal();
}

function update() {
  const mesh = data.meshes[state.mesh];
  updates.forEach((show) => show());
  byId("exact").src = png(data.exact);
  byId("heat").checked = state.view === "heat";
  if (!mesh) return;
  byId("other").src = png(mesh.pictures[state.view]);
  byId("tag").textContent = data.views.find(([key]) => key === state.view)[1];
  const places = mesh.crops.map((crop) => {
    const button = document.createElement("button");
    const image = document.createElement("img");
    const text = document.createElement("span");
    image.src = png(crop.mesh);
    image.alt = "";
    text.textContent = crop.text;
    button.type = "button";
    button.append(image, text);
    button.addEventListener("click", () => showCrop(mesh, crop));
    return button;
  });
  byId("worst").replaceChildren(...places);
  if (!places.length) byId("worst").textContent = "Surfaces and mesh are nowhere apart.";
  solid.load(mesh.solid);
}

// The mesh in the browser: no library, no network.
const solid = (() => {
  const canvas = byId("solid");
  const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
  const note = byId("solid-note");
  const hint = note.textContent;
  let turn = [0.6, -0.5], zoom = 1, loaded = null;
  if (!gl) {
    note.textContent = "This browser shows no WebGL; the files beside this page hold the mesh.";
    return { load() {} };
  }
  const compile = (kind, text) => {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    return shader;
  };
  const program = gl.createProgram();
  gl.attachShader(program, compile(gl.VERTEX_SHADER, `#version 300 es
    in vec3 share; in float shade; uniform vec3 size; uniform mat3 turn; uniform vec2 scale;
    out vec3 at; out float heat;
    void main() {
      at = turn * ((share - 0.5) * size); heat = shade;
      gl_Position = vec4(at.xy * scale, -at.z * 0.45, 1.0);
    }`));
  gl.attachShader(program, compile(gl.FRAGMENT_SHADER, `#version 300 es
    precision highp float; in vec3 at; in float heat; uniform float colored; out vec4 color;
    vec3 map(float t) {
      vec3 a = vec3(0.267, 0.005, 0.329), b = vec3(0.129, 0.565, 0.552), c = vec3(0.993, 0.906, 0.144);
      return t < 0.5 ? mix(a, b, 2.0 * t) : mix(b, c, 2.0 * t - 1.0);
    }
    void main() {
      vec3 n = normalize(cross(dFdx(at), dFdy(at)));
      float light = 0.35 + 0.65 * abs(dot(n, normalize(vec3(0.3, 0.5, 0.8))));
      color = vec4(mix(vec3(0.75, 0.78, 0.82), map(heat), colored) * light, 1.0);
    }`));
  gl.linkProgram(program);
  gl.useProgram(program);
  gl.enable(gl.DEPTH_TEST);
  const place = (name) => gl.getUniformLocation(program, name);
  const bytes = (coded) => Uint8Array.from(atob(coded), (c) => c.charCodeAt(0));
  const attribute = (name, list, width, kind) => {
    const at = gl.getAttribLocation(program, name);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, list, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(at);
    gl.vertexAttribPointer(at, width, kind, true, 0, 0);
  };
  function draw() {
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.933, 0.941, 0.949, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (!loaded) return;
    const [cy, sy, cx, sx] = [Math.cos(turn[0]), Math.sin(turn[0]), Math.cos(turn[1]), Math.sin(turn[1])];
    // Turned about the upward axis, then tilted; columns for WebGL.
    const upright = data.up === "Z"
      ? [cy, sx * sy, cx * sy, -sy, sx * cy, cx * cy, 0, cx, -sx]
      : [cy, -sx * -sy, -cx * sy, 0, cx, -sx, sy, sx * cy, cx * cy];
    gl.uniformMatrix3fv(place("turn"), false, upright);
    gl.uniform3fv(place("size"), loaded.size);
    const fit = 1.5 * zoom;
    gl.uniform2f(place("scale"), fit * canvas.height / canvas.width, fit);
    gl.uniform1f(place("colored"), byId("heat").checked ? 1 : 0);
    gl.drawElements(gl.TRIANGLES, loaded.count, gl.UNSIGNED_INT, 0);
  }
  let pointer = null;
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointer = [event.clientX, event.clientY];
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!event.buttons || !pointer) return;
    turn = [turn[0] + (event.clientX - pointer[0]) * 0.01, turn[1] + (event.clientY - pointer[1]) * 0.01];
    pointer = [event.clientX, event.clientY];
    draw();
  });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom *= Math.exp(-event.deltaY * 0.001);
    draw();
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const steps = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] };
    const step = steps[event.key];
    if (step) turn = [turn[0] + step[0], turn[1] + step[1]];
    else if (event.key === "+") zoom *= 1.1;
    else if (event.key === "-") zoom /= 1.1;
    else return;
    event.preventDefault();
    draw();
  });
  return {
    load(mesh) {
      note.textContent = mesh ? hint : "There are too many triangles, or none, to show here.";
      loaded = mesh && { size: mesh.size, count: mesh.count };
      if (mesh) {
        attribute("share", new Uint16Array(bytes(mesh.points).buffer), 4, gl.UNSIGNED_SHORT);
        attribute("shade", bytes(mesh.shades), 1, gl.UNSIGNED_BYTE);
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
        gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, bytes(mesh.triangles), gl.STATIC_DRAW);
      }
      draw();
    },
  };
})();
update();
