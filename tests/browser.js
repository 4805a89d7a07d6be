// Run inside a page by browser.py: what reaches past the window, and which texts are too faint.
await document.fonts.ready;

const canvas = document.createElement("canvas").getContext("2d", { willReadFrequently: true });

// Any CSS colour as red, green, blue (0..255) and opacity.
function rgba(colour) {
  canvas.clearRect(0, 0, 1, 1);
  canvas.fillStyle = colour;
  canvas.fillRect(0, 0, 1, 1);
  const [r, g, b, a] = canvas.getImageData(0, 0, 1, 1).data;
  return [r, g, b, a / 255];
}

function over(front, share, back) {
  return [0, 1, 2].map((i) => front[i] * share + back[i] * (1 - share));
}

// The colour behind an element: its own background and those of its ancestors, on the canvas's.
function behind(element) {
  const paper = matchMedia("(prefers-color-scheme: dark)").matches ? [18, 18, 18] : [255, 255, 255];
  const layers = [];
  for (let at = element; at; at = at.parentElement) layers.push(rgba(getComputedStyle(at).backgroundColor));
  return layers.reverse().reduce((back, layer) => over(layer, layer[3], back), paper);
}

// Relative luminance and contrast ratio of WCAG 2.
function luminance(colour) {
  const [r, g, b] = colour.map((v) => (v / 255 <= 0.04045 ? v / 255 / 12.92 : ((v / 255 + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}

function contrast(one, other) {
  const [low, high] = [luminance(one), luminance(other)].sort((a, b) => a - b);
  return (high + 0.05) / (low + 0.05);
}

function opacity(element) {
  let share = 1;
  for (let at = element; at; at = at.parentElement) share *= Number(getComputedStyle(at).opacity);
  return share;
}

const faint = [];
const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
while (texts.nextNode()) {
  const element = texts.currentNode.parentElement;
  const text = texts.currentNode.textContent.trim();
  const box = element.getBoundingClientRect();
  if (!text || !box.width || !box.height) continue;
  const style = getComputedStyle(element);
  const ink = rgba(element instanceof SVGElement ? style.fill : style.color);
  const back = behind(element);
  const ratio = contrast(over(ink, ink[3] * opacity(element), back), back);
  const size = parseFloat(style.fontSize);
  const large = size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 700);
  const needed = large ? 3 : 4.5;
  if (ratio < needed) faint.push({ text: text.slice(0, 60), contrast: Number(ratio.toFixed(2)), needed });
}

// Inside a box that scrolls an element may be as wide as it likes.
function scrolls(element) {
  for (let at = element.parentElement; at && at !== document.body; at = at.parentElement)
    if (["auto", "scroll", "hidden"].includes(getComputedStyle(at).overflowX)) return true;
  return false;
}

const width = document.documentElement.clientWidth;
const overflow = [...document.body.querySelectorAll("*")]
  .filter((e) => !(e instanceof SVGElement && e.tagName !== "svg"))
  .filter((e) => e.getBoundingClientRect().right > width + 0.5 && !scrolls(e))
  .map((e) => `${e.tagName.toLowerCase()}.${e.getAttribute("class") ?? ""}: ${e.textContent.trim().slice(0, 40)}`);
if (document.documentElement.scrollWidth > width)
  overflow.push(`the page is ${document.documentElement.scrollWidth} px wide in ${width} px`);

return { faint, overflow, dom: document.documentElement.outerHTML };
