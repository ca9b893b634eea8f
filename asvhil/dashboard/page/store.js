// What stays when the page is loaded anew. Where a browser denies storage, or has none left: until it is closed.

const kept = new Map();

// `area`: sessionStorage (this tab) or localStorage (this browser). Null where nothing is kept under the name.
export function recall(area, name) {
  try {
    return kept.get(name) ?? window[area].getItem(name);
  } catch {
    return null;
  }
}

export function keep(area, name, text) {
  kept.set(name, text);
  try {
    window[area].setItem(name, text);
  } catch {
    // the page has it as long as it is open
  }
}

export function forget(area, name) {
  kept.delete(name);
  try {
    window[area].removeItem(name);
  } catch {
    // where nothing can be removed, nothing was kept
  }
}
