// The colon with the device in it, from outside, that can be turned.
import {
  AmbientLight, BufferAttribute, BufferGeometry, Color, DirectionalLight, DoubleSide, Mesh, MeshLambertMaterial,
  PerspectiveCamera, Scene, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

const AROUND = 12; // corners of the device's rings
const FLESH = new Color(0xe59a90), RED = new Color(0xd01510), BLUE = new Color(0x3355dd);
const MOST = { pressed: 15, pain: 2, gas: 4000 }; // where colours end: N, 1, Pa

// What draws, or null where the browser has no WebGL: the rest of the page does without this view.
const rendererOf = (canvas, slow) => {
  try {
    return new WebGLRenderer({ canvas, antialias: !slow, alpha: true });
  } catch {
    [canvas.width, canvas.height] = [640, 360];
    const pen = canvas.getContext("2d");
    [pen.fillStyle, pen.font, pen.textAlign] = ["#8a949e", "20px sans-serif", "center"];
    pen.fillText("No WebGL in this browser: no view from outside.", 320, 180);
    return null;
  }
};

// Whether WebGL is drawn by the processor, which then has better things to do than many and smooth pixels.
const drawnBySoftware = () => {
  const gl = document.createElement("canvas").getContext("webgl");
  const about = gl && gl.getExtension("WEBGL_debug_renderer_info");
  const name = about ? gl.getParameter(about.UNMASKED_RENDERER_WEBGL) : "";
  if (gl && gl.getExtension("WEBGL_lose_context")) gl.getExtension("WEBGL_lose_context").loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
};

export class Outside {
  constructor(canvas, scene) {
    this.canvas = canvas;
    this.shows = "pressed";
    const slow = drawnBySoftware();
    this.renderer = rendererOf(canvas, slow);
    this.renderer?.setPixelRatio(slow ? 0.5 : Math.min(window.devicePixelRatio, 1.5));
    this.scene = new Scene();
    this.scene.add(new AmbientLight(0xffffff, 1.6));
    this.light = new DirectionalLight(0xffffff, 1.8);
    this.scene.add(this.light);
    this.camera = new PerspectiveCamera(30, 1, 0.01, 10);
    this.stations = scene.arrays.stations;
    this.radius = scene.radius;
    this.colon = new BufferGeometry();
    const rest = scene.arrays.rest;
    this.colon.setAttribute("position", new BufferAttribute(new Float32Array(rest), 3));
    this.colon.setAttribute("color", new BufferAttribute(new Float32Array(rest.length).fill(1), 3));
    this.colon.setIndex(new BufferAttribute(new Uint32Array(scene.arrays.faces), 1));
    const wall = { vertexColors: true, transparent: true, depthWrite: false, side: DoubleSide };
    this.scene.add(new Mesh(this.colon, new MeshLambertMaterial({ ...wall, opacity: 0.38 })));
    this.device = new BufferGeometry();
    const skin = new Mesh(this.device, new MeshLambertMaterial({ vertexColors: true }));
    skin.frustumCulled = false;
    skin.renderOrder = -1;
    this.scene.add(skin);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableKeys = false;
    this.controls.addEventListener("change", () => this.draw());
    this._face(rest);
    new ResizeObserver(() => this.draw()).observe(canvas.parentElement);
  }

  // The patient is seen from the front: x to the left, y to the back, z to the head.
  _face(points) {
    this.colon.computeBoundingSphere();
    const { center, radius } = this.colon.boundingSphere;
    this.controls.target.copy(center);
    this.camera.up.set(0, 0, 1);
    this.camera.position.copy(center).add(new Vector3(0.15 * radius, -4.1 * radius, 0.5 * radius));
    this.controls.update();
  }

  update({ vertices, shape, pressed, pain, gas }) {
    const place = this.colon.attributes.position;
    if (vertices) {
      place.array.set(vertices);
      place.needsUpdate = true;
    }
    const values = { pressed, pain, gas }[this.shows] || pressed;
    const colours = this.colon.attributes.color, mixed = new Color();
    for (let i = 0; i < this.stations.length; i++) {
      const share = Math.min((values[Math.min(this.stations[i], values.length - 1)] || 0) / MOST[this.shows], 1);
      mixed.copy(FLESH).lerp(this.shows === "gas" ? BLUE : RED, share);
      colours.setXYZ(i, mixed.r, mixed.g, mixed.b);
    }
    colours.needsUpdate = true;
    if (vertices || !this.colon.attributes.normal) this.colon.computeVertexNormals();
    this._tube(shape);
    this.draw();
  }

  // A tube of the device's radius along its axis, carried from ring to ring without twist, marked every ten centimetres.
  _tube(shape) {
    const count = shape.length / 3, points = [];
    for (let i = 0; i < count; i++) points.push(new Vector3(shape[3 * i], shape[3 * i + 1], shape[3 * i + 2]));
    const total = (count + 1) * AROUND, places = new Float32Array(3 * total), colours = new Float32Array(3 * total);
    const normals = new Float32Array(3 * total), along = new Vector3(), side = new Vector3(1, 0, 0), other = new Vector3();
    const behind = new Array(count).fill(0);
    for (let i = count - 2; i >= 0; i--) behind[i] = behind[i + 1] + points[i].distanceTo(points[i + 1]);
    for (let i = 0; i <= count; i++) {
      const k = Math.min(i, count - 1), here = points[k];
      along.copy(points[Math.min(k + 1, count - 1)]).sub(points[Math.max(k - 1, 0)]).normalize();
      side.addScaledVector(along, -side.dot(along));
      if (side.lengthSq() < 1e-6) side.set(along.y, along.z, -along.x).addScaledVector(along, -along.x);
      side.normalize();
      other.crossVectors(along, side);
      const radius = i > count - 1 ? 1e-4 : this.radius;
      const shade = behind[k] < 0.1 ? 0.12 : Math.floor(behind[k] / 0.1 + 1e-6) % 2 ? 0.3 : 0.2;
      for (let j = 0; j < AROUND; j++) {
        const angle = (2 * Math.PI * j) / AROUND, c = Math.cos(angle), s = Math.sin(angle), at = 3 * (i * AROUND + j);
        for (const [axis, name] of ["x", "y", "z"].entries()) {
          normals[at + axis] = c * side[name] + s * other[name];
          places[at + axis] = here[name] + radius * normals[at + axis];
          colours[at + axis] = shade + (axis === 2 ? 0.05 : 0);
        }
      }
    }
    if (!this.device.index || this.device.attributes.position.array.length !== places.length) {
      const faces = [];
      for (let i = 0; i < count; i++) {
        for (let j = 0; j < AROUND; j++) {
          const a = i * AROUND + j, b = i * AROUND + ((j + 1) % AROUND);
          faces.push(a, b, a + AROUND, b, b + AROUND, a + AROUND);
        }
      }
      this.device.setIndex(faces);
    }
    this.device.setAttribute("position", new BufferAttribute(places, 3));
    this.device.setAttribute("normal", new BufferAttribute(normals, 3));
    this.device.setAttribute("color", new BufferAttribute(colours, 3));
  }

  draw() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      if (!this.renderer) return;
      const { clientWidth, clientHeight } = this.canvas.parentElement;
      if (!clientWidth || !clientHeight) return;
      const ratio = this.renderer.getPixelRatio();
      if (this.canvas.width !== Math.floor(clientWidth * ratio) || this.canvas.height !== Math.floor(clientHeight * ratio)) {
        this.renderer.setSize(clientWidth, clientHeight, false);
        this.camera.aspect = clientWidth / clientHeight;
        this.camera.updateProjectionMatrix();
      }
      this.light.position.copy(this.camera.position);
      this.renderer.render(this.scene, this.camera);
      this.drawn = (this.drawn || 0) + 1;
    });
  }
}
