// The token of the controls, for this tab: typed in, of the address, or of before.

// As `read_token` of access.py has it; with anything else in it the browser would send no request at all.
const PRINTABLE = /^[\x21-\x7e]+$/;
export const NO_TOKEN = "That is no token: it is one word of letters, digits and signs of ASCII. Nothing was changed.";

// Whether it is one, and is kept from now on.
export function keepToken(text) {
  if (!PRINTABLE.test(text)) return false;
  sessionStorage.setItem("token", text);
  return true;
}

export function keptToken() {
  const text = sessionStorage.getItem("token") ?? "";
  return PRINTABLE.test(text) ? text : "";
}

export function forgetToken() {
  sessionStorage.removeItem("token");
}

// The token in a "#token=..." of the address; null where there is none.
export function tokenOfAddress(hash) {
  const found = /(?:^#|&)token=([^&]+)/.exec(hash);
  return found && decodeURIComponent(found[1]);
}
