// Small helpers; everything foreign enters the page as text, never as markup.
export const byId = (id) => document.getElementById(id);

export function make(tag, className, text) {
  const node = document.createElement(tag);
  if (className) node.className = className;
  if (text !== undefined) node.textContent = text;
  return node;
}

export function put(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

export const isNumber = (value) => typeof value === "number" && Number.isFinite(value);

export function fixed(value, digits, unit = "") {
  if (!isNumber(value)) return "–";
  const text = value.toFixed(digits);
  return (Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−")) + (unit && ` ${unit}`);
}

// The six coordinates of a pose: name, unit shown, units per SI unit, decimals shown.
const MM = 1e3, DEG = 180 / Math.PI;
export const POSE = [["surge", "mm", MM, 0], ["sway", "mm", MM, 0], ["heave", "mm", MM, 0], ["roll", "°", DEG, 1], ["pitch", "°", DEG, 1], ["yaw", "°", DEG, 1]];

export const list = (value) => (Array.isArray(value) ? value : []);
