// The token of the controls, for this tab: typed in, of the address, or of before.

import { forget, keep, recall } from "./store.js";

// As `read_token` of access.py has it; with anything else in it the browser would send no request at all.
const PRINTABLE = /^[\x21-\x7e]+$/;
export const NO_TOKEN = "That is no token: it is one word of letters, digits and signs of ASCII. Nothing was changed.";

// Whether it is one, and is kept from now on.
export function keepToken(text) {
  if (!PRINTABLE.test(text)) return false;
  keep("sessionStorage", "token", text);
  return true;
}

export function keptToken() {
  const text = recall("sessionStorage", "token") ?? "";
  return PRINTABLE.test(text) ? text : "";
}

export function forgetToken() {
  forget("sessionStorage", "token");
}

// The token in a "#token=..." of the address; null where there is none, and empty where it is damaged.
export function tokenOfAddress(hash) {
  const found = /(?:^#|&)token=([^&]*)/.exec(hash);
  if (!found) return null;
  try {
    return decodeURIComponent(found[1]);
  } catch {
    return "";
  }
}
