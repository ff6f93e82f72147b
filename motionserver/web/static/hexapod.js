// The hexapod on a canvas: twelve joints, six legs, the driver's head, a gentle camera.
import { isNumber, list } from "./dom.js";

const CALM = [86, 180, 233], BUSY = [240, 212, 66], END = [255, 122, 69];
const still = matchMedia("(prefers-reduced-motion: reduce)").matches;

export function strokeColour(share, alpha = 1) {
  const use = Math.min(Math.abs(2 * share - 1), 1);
  const [from, to, s] = use < 0.7 ? [CALM, BUSY, Math.max(0, (use - 0.25) / 0.45)] : [BUSY, END, (use - 0.7) / 0.3];
  const mix = from.map((c, i) => Math.round(c + (to[i] - c) * s));
  return `rgba(${mix.join(",")},${alpha})`;
}

function rotation([roll, pitch, yaw]) {
  const [sr, cr, sp, cp, sy, cy] = [Math.sin(roll), Math.cos(roll), Math.sin(pitch), Math.cos(pitch), Math.sin(yaw), Math.cos(yaw)];
  return [
    [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
    [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
    [-sp, cp * sr, cp * cr],
  ];
}

export class Hexapod {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.pose = null;
    this.turn = 0.5;
    this.lift = 0.34;
    this.status = null;
    this.drag();
    new ResizeObserver(() => this.fit()).observe(canvas);
    this.fit();
  }

  fit() {
    const ratio = devicePixelRatio || 1;
    this.width = this.canvas.clientWidth;
    this.height = this.canvas.clientHeight;
    this.canvas.width = this.width * ratio;
    this.canvas.height = this.height * ratio;
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
  }

  drag() {
    let last = null;
    this.canvas.addEventListener("pointerdown", (e) => { last = e; this.canvas.setPointerCapture(e.pointerId); });
    // also when the browser takes the pointer away, to scroll: no pointerup follows then
    this.canvas.addEventListener("lostpointercapture", () => { last = null; });
    this.canvas.addEventListener("pointermove", (e) => {
      if (!last) return;
      this.turn -= (e.clientX - last.clientX) * 0.008;
      this.lift = Math.min(1.2, Math.max(0.02, this.lift + (e.clientY - last.clientY) * 0.006));
      last = e;
    });
  }

  // World point to screen; the camera looks at a point a little above the middle of the legs.
  project([x, y, z]) {
    const sway = still ? 0 : 0.07 * Math.sin(performance.now() / 5200);
    const [ca, sa] = [Math.cos(this.turn + sway), Math.sin(this.turn + sway)];
    const [cl, sl] = [Math.cos(this.lift), Math.sin(this.lift)];
    const depth = x * ca + y * sa;
    const right = y * ca - x * sa;
    const [up, far] = [(z - this.middle) * cl + depth * sl, depth * cl - (z - this.middle) * sl];
    const zoom = 7.2 / (7.2 + far);
    const size = Math.min(this.height / 2.45, this.width / 3.5) * zoom;
    return [this.width / 2 - right * size, this.height * 0.43 - up * size, far];
  }

  line(a, b, colour, width, dash = []) {
    const c = this.context;
    c.strokeStyle = colour;
    c.lineWidth = width;
    c.setLineDash(dash);
    c.beginPath();
    c.moveTo(a[0], a[1]);
    c.lineTo(b[0], b[1]);
    c.stroke();
  }

  face(points, fill, stroke, dash = []) {
    const c = this.context;
    c.beginPath();
    points.forEach((p, i) => (i ? c.lineTo(p[0], p[1]) : c.moveTo(p[0], p[1])));
    c.closePath();
    if (fill) { c.fillStyle = fill; c.fill(); }
    c.setLineDash(dash);
    c.strokeStyle = stroke;
    c.lineWidth = 1.6;
    c.stroke();
  }

  dot(p, radius, fill) {
    const c = this.context;
    c.beginPath();
    c.arc(p[0], p[1], radius, 0, 2 * Math.PI);
    c.fillStyle = fill;
    c.fill();
  }

  label(p, text, colour) {
    const c = this.context;
    c.fillStyle = colour;
    c.font = "600 12px system-ui, sans-serif";
    c.textAlign = "center";
    c.textBaseline = "middle";
    c.strokeStyle = "#151c23";
    c.lineWidth = 4;
    c.setLineDash([]);
    c.strokeText(text, p[0], p[1]);
    c.fillText(text, p[0], p[1]);
  }

  draw() {
    const { machine, guard } = this.status || {};
    const wanted = list(guard?.pose);
    if (!machine?.base_joints || wanted.length !== 6 || !wanted.every(isNumber)) return;
    this.pose = this.pose ? this.pose.map((v, i) => v + (wanted[i] - v) * 0.4) : wanted.slice();
    const c = this.context;
    c.clearRect(0, 0, this.width, this.height);
    c.lineCap = "round";
    c.lineJoin = "round";
    const height = machine.neutral_height;
    this.middle = height * 0.56;
    this.floor();
    const base = machine.base_joints;
    const carried = (points, pose) => {
      const r = rotation(pose.slice(3));
      return points.map((p) => r.map((row, i) => row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + pose[i] + (i === 2 ? height : 0)));
    };
    const top = carried(machine.platform_joints, this.pose);
    const neutral = carried(machine.platform_joints, [0, 0, 0, 0, 0, 0]);
    const see = (points) => points.map((p) => this.project(p));
    this.face(see(base), "rgba(120,140,160,.10)", "rgba(143,161,179,.65)");
    this.face(see(neutral), null, "rgba(143,161,179,.32)", [3, 5]);
    this.legs(base, top, guard);
    this.face(see(top), "rgba(86,180,233,.20)", "rgba(232,237,242,.9)");
    const head = machine.head || [0, 0, 0];
    const [origin, seat] = carried([head, [head[0], head[1], machine.platform_joints[0][2]]], this.pose);
    const [o, s] = see([origin, seat]);
    this.line(s, o, "rgba(232,237,242,.45)", 2);
    const arms = carried([[0.42, 0, 0], [0, 0.42, 0], [0, 0, 0.42]].map((a) => a.map((v, i) => v + head[i])), this.pose);
    [["x fwd", "#e69f00"], ["y", "#35c9a3"], ["z", "#d79ac0"]].forEach(([name, colour], i) => {
      const tip = this.project(arms[i]);
      this.line(o, tip, colour, 2.2);
      this.label([tip[0] + (tip[0] - o[0]) * (i ? 0.16 : 0.4), tip[1] + (tip[1] - o[1]) * 0.16], name, colour);
    });
    this.dot(o, 8, "#0d1217");
    this.dot(o, 6.2, "#e8edf2");
  }

  floor() {
    for (let i = -3; i <= 3; i += 1) {
      const k = i * 0.6;
      this.line(this.project([k, -1.8, 0]), this.project([k, 1.8, 0]), "rgba(143,161,179,.10)", 1);
      this.line(this.project([-1.8, k, 0]), this.project([1.8, k, 0]), "rgba(143,161,179,.10)", 1);
    }
  }

  legs(base, top, guard) {
    const limits = guard.limits || {};
    const order = base.map((_, i) => i).sort((a, b) => this.project(base[b])[2] - this.project(base[a])[2]);
    for (const i of order) {
      const length = list(guard.legs)[i];
      const share = (length - limits.leg_min) / (limits.leg_max - limits.leg_min);
      const colour = strokeColour(isNumber(share) ? share : 0.5);
      const knee = base[i].map((v, k) => v + (top[i][k] - v) * 0.56);
      const [a, m, b] = [this.project(base[i]), this.project(knee), this.project(top[i])];
      this.line(a, b, "#0d1217", 9);
      this.line(a, m, colour, 6.5);
      this.line(m, b, colour, 3.2);
      this.dot(a, 4.5, "#8fa1b3");
      this.dot(b, 4, "#e8edf2");
      this.label([a[0], a[1] + 14], String(i + 1), "#9fadba");
    }
  }
}
