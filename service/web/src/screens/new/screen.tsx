export function NewScreen({ query }: { query: URLSearchParams }) {
  return (
    <h1>
      New {query.toString()}
    </h1>
  );
}
