// Where the API is, and who calls it.

const TOKEN = "uavapi-token"; // in sessionStorage: it ends with the tab

/** The address of a path of the API. It is relative to the page, which may be below a path of a proxy. */
export const addressOf = path => `.${path}`;

/** The token of this tab; null for none. */
export const tokenOf = () => sessionStorage.getItem(TOKEN);

export function keepToken(token) {
  if (token) sessionStorage.setItem(TOKEN, token);
  else sessionStorage.removeItem(TOKEN);
}

/** The headers of a call with that token, or with none. */
export const headersOf = (token, more = {}) => (token === null ? more : {...more, Authorization: `Bearer ${token}`});
