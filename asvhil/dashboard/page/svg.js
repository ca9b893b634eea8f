// Drawing in SVG, with nodes that are kept: the page redraws five times a second.

const SPACE = "http://www.w3.org/2000/svg";

export class Drawing {
  constructor(root) {
    this.root = root;
    this.kept = new Map();
    this.used = new Set();
  }

  begin(width, height) {
    this.root.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.used.clear();
  }

  // A node by its key, made at its first use; keys stay in the order of that.
  node(key, kind, attributes, text) {
    let node = this.kept.get(key);
    if (!node) {
      node = document.createElementNS(SPACE, kind);
      this.kept.set(key, node);
    }
    this.root.appendChild(node);
    this.used.add(key);
    for (const [name, value] of Object.entries(attributes)) {
      if (node.getAttribute(name) !== String(value)) node.setAttribute(name, value);
    }
    if (text !== undefined && node.textContent !== text) node.textContent = text;
    return node;
  }

  end() {
    for (const [key, node] of this.kept) {
      if (!this.used.has(key)) {
        node.remove();
        this.kept.delete(key);
      }
    }
  }
}

export const points = (list) => list.map(([x, y]) => `${x.toFixed(1)},${y.toFixed(1)}`).join(" ");
